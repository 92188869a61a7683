"""Who watches the watchers: the independent checker, and the mutants that it must find."""

from gates.asked_for import CHECKS_ASKED_FOR
from gates.criterion import Measured, criterion
from gates.evidence import Evidence, MissingEvidenceError
from gates.feasibility.settings import SHADOW, FeasibilitySettings
from genpolicy.evidence.documents.shadow import CHECKER, MUTANTS, LayerMutant


@criterion(
    "<=",
    question="What does the independent checker find in the journal?",
    look_at="Evaluator: executor and independent checker disagree; read the violations.",
    always=True,
)
def checker_violations(evidence: Evidence, settings: FeasibilitySettings) -> Measured:
    """Violations that the independent checker found in the journal."""
    return checked_violations(evidence, SHADOW)


def checked_violations(evidence: Evidence, folder: str) -> Measured:
    """Violations that the independent checker found; none counts only if it proved every action.

    Raises:
        MissingEvidenceError: It checked nothing, or did not prove the motion of what it checked.
    """
    found = evidence.document(folder, CHECKER)
    checked, proved = found.checked_actions, found.reproved_actions
    if checked <= 0:
        raise MissingEvidenceError("the checker saw no action")
    if not proved >= checked:
        raise MissingEvidenceError(f"the motion of {proved} of {checked} actions was proved")
    text = f"{checked} actions proved again, their motion by other geometry"
    return Measured(float(len(found.violations)), caveat=text)


@criterion(
    "<=",
    question="Does disabling any one check turn the checker red?",
    look_at="Evaluator: a check left out goes unnoticed, so its green means nothing.",
    always=True,
)
def mutants_undetected(evidence: Evidence, settings: FeasibilitySettings) -> Measured:
    """Checks whose absence was not noticed, or that were not tried.

    Asked for is every check of the code; which of them a task has no chunk for, the evidence says.
    """
    found, missed, excused = set[str](), dict[str, None](), dict[str, str]()
    for entry in evidence.document(SHADOW, MUTANTS):
        name = f"{entry.layer}.{entry.check}"
        found.add(name)
        if entry.detected:
            continue
        if isinstance(entry, LayerMutant) and entry.not_applicable and not entry.tried:
            excused[name] = entry.not_applicable
        else:  # an excuse in another row of the same check does not undo it
            missed[name] = None
    silent = [*missed]
    silent += [f"{name} (not tried)" for name in CHECKS_ASKED_FOR if name not in found]
    text = f"not detected: {', '.join(silent)}" if silent else f"all {len(found)} detected"
    if excused:
        listed = ", ".join(f"{name} ({reason})" for name, reason in excused.items())
        text += f"; of them not asked of this task: {listed}"
    return Measured(float(len(silent)), caveat=text)
