"""`conformance.json` of reload: what answers of a brought policy at recorded moments say of it."""

from dataclasses import dataclass

from genpolicy.candidates.conformance.finding import Finding
from genpolicy.documents.document import Count, Document


@dataclass(frozen=True)
class Conformance:
    """What was asked of one candidate, and what was found.

    Attributes:
        episodes: Held-out episodes that the moments are of, each with as many.
        moments: Recorded moments.
        candidates: Chunks asked for at each.
        observations_sha256: Of what it was shown at the moments that it was asked twice.
        seeded: Whether its server says that equal names of noise give equal chunks.
        counts_evaluations: Whether it says that it counts network evaluations.
        most_candidates: Most chunks that it says it draws in one message.
        findings: What follows from its answers.
    """

    episodes: Count
    moments: Count
    candidates: Count
    observations_sha256: str
    seeded: bool
    counts_evaluations: bool
    most_candidates: Count
    findings: list[Finding]


CONFORMANCE = Document("conformance.json", dict[str, Conformance])
"""By name of the candidate."""
