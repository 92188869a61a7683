"""What a policy that was brought answers at recorded moments: the same again, in declared units."""

from gates.criterion import Measured, criterion
from gates.evidence import Evidence, MissingEvidenceError
from gates.reproducibility.settings import RELOAD, ReproducibilitySettings
from genpolicy.candidates.conformance.finding import OF_ANSWERS, Finding
from genpolicy.evidence.documents.conformance import CONFORMANCE

NEEDED = ("answers", "repeats", "restarts", "seeded", "follows_observation", "own_answers")
"""What must be known: the gate's own question, and what numbers of twenty moments always tell.

Of the others, evaluations that nobody counts are the matter of `nfe_mismatch`; scale, origin and
orientation stay open where an honest policy is weak or its robot does not say where it is, and
gates C and D see what comes of it.
"""


@criterion(
    "<=",
    question="Does it answer recorded moments again the same, from them, and in declared units?",
    look_at="Entry and server: `genpolicy check-candidate` looks at the same in a minute.",
    per_candidate=True,
    always=True,
)
def conformance(evidence: Evidence, settings: ReproducibilitySettings, candidate: str) -> Measured:
    """Findings of the conformance kit that fail, by name."""
    found = evidence.document(RELOAD, CONFORMANCE).get(candidate)
    if found is None:
        raise MissingEvidenceError(f"{RELOAD}/{CONFORMANCE.file} has no entry of {candidate}")
    by_name = {one.name: one for one in found.findings}
    if lacking := [name for name in OF_ANSWERS if name not in by_name]:
        raise MissingEvidenceError(f"nothing is said of {', '.join(lacking)}")
    failed = [one for one in found.findings if one.judged == "fails"]
    unknown = [one for one in found.findings if one.judged == "unknown"]
    needed = [one for one in unknown if one.name in NEEDED]
    if needed and not failed:
        raise MissingEvidenceError(_listed(needed))
    parts = [_listed(failed)] if failed else []
    if unknown:
        parts.append(f"unknown: {', '.join(one.name for one in unknown)}")
    held = [one.name for one in found.findings if one.judged == "holds"]
    parts.append(f"holds: {', '.join(held) or 'nothing'}")
    counted = f"{found.episodes} held-out episodes, {found.moments} recorded moments"
    return Measured(float(len(failed)), caveat="; ".join(parts), counted=counted)


def _listed(findings: list[Finding]) -> str:
    return "; ".join(f"{one.name}: {one.said}" for one in findings)
