"""The multimodality audit: is there a need for a generator, and if not, what is wrong?

The entry points are imported when they are asked for, so that who needs only the rows of the
tables (`genpolicy.audit.rows`) does not import the audit.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from genpolicy.audit.propose import propose_settings
    from genpolicy.audit.standalone import AuditReport, audit

__all__ = ["AuditReport", "audit", "propose_settings"]

_HOMES = {"AuditReport": "standalone", "audit": "standalone", "propose_settings": "propose"}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
