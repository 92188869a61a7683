"""The multimodality audit: is there a need for a generator, and if not, what is wrong?"""

from genpolicy.audit.propose import propose_settings
from genpolicy.audit.standalone import AuditReport, audit

__all__ = ["AuditReport", "audit", "propose_settings"]
