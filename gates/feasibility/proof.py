"""Who watches the watchers: the independent checker, and the mutants that it must find."""

from pathlib import PurePosixPath

from gates.asked_for import CHECKS_ASKED_FOR, NOT_ASKED_OF_EVERY_TASK
from gates.criterion import Measured, criterion
from gates.evidence import Evidence, MissingEvidenceError
from gates.feasibility.settings import JOURNALS, SHADOW, FeasibilitySettings
from gates.words import number
from genpolicy.evidence.documents.shadow import CHECKER, MUTANTS, Checked, LayerMutant


@criterion(
    "<=",
    question="What does the independent checker find in the journal?",
    look_at="Evaluator: executor and independent checker disagree; read the violations.",
    always=True,
)
def checker_violations(evidence: Evidence, settings: FeasibilitySettings) -> Measured:
    """Violations that the independent checker found in the journal."""
    return checked_violations(evidence, SHADOW, JOURNALS)


def checked_violations(evidence: Evidence, folder: str, journals: str) -> Measured:
    """Violations that the independent checker found; none counts only if it proved every action.

    Args:
        evidence: What there is.
        folder: Folder of the checker's document.
        journals: Glob pattern of the journals that it must speak of.

    Raises:
        MissingEvidenceError: It checked nothing, did not prove the motion of what it checked, does
            not speak of just the journals that are there, or its totals are not theirs.
    """
    found = evidence.document(folder, CHECKER)
    named = {PurePosixPath(path).name for path in evidence.bind(journals)}
    if differing := sorted(named ^ set(found.journals)):
        raise MissingEvidenceError(
            f"journal and finding do not belong together: {', '.join(differing[:3])}"
            + (f" and {len(differing) - 3} more" if len(differing) > 3 else "")
        )
    checked, proved = found.checked_actions, found.reproved_actions
    if checked <= 0:
        raise MissingEvidenceError("the checker saw no action")
    if not proved >= checked:
        raise MissingEvidenceError(f"the motion of {proved} of {checked} actions was proved")
    _require_totals(found)
    text = f"{number(checked)} actions proved again, their motion by other geometry"
    broken = max(len(found.violations), sum(len(one.violations) for one in found.journals.values()))
    return Measured(float(broken), caveat=text, counted=f"all {checked} actions")


def _require_totals(found: Checked) -> None:
    """What is judged is the sum; a journal of which nothing was checked would not be seen."""
    each = found.journals.values()
    for what, stated, summed in (
        ("checked actions", found.checked_actions, sum(one.checked_actions for one in each)),
        ("proved actions", found.reproved_actions, sum(one.reproved_actions for one in each)),
    ):
        if stated != summed:
            raise MissingEvidenceError(f"{stated} {what} in all, {summed} in the journals")


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
        if isinstance(entry, LayerMutant) and _is_excused(name, entry):
            excused[name] = entry.not_applicable
        else:  # an excuse in another row of the same check does not undo it
            missed[name] = None
    silent = [*missed]
    silent += [f"{name} (not tried)" for name in CHECKS_ASKED_FOR if name not in found]
    text = f"not detected: {', '.join(silent)}" if silent else f"all {len(found)} detected"
    if excused:
        listed = ", ".join(f"{name} ({reason})" for name, reason in excused.items())
        text += f"; of them not asked of this task: {listed}"
    tried = (found | set(CHECKS_ASKED_FOR)) - (set(excused) - set(missed))
    return Measured(float(len(silent)), caveat=text, counted=f"all {len(tried)} mutants")


def _is_excused(name: str, entry: LayerMutant) -> bool:
    """A task may lack what a check needs, if the check needs anything that a task may lack."""
    return name in NOT_ASKED_OF_EVERY_TASK and bool(entry.not_applicable) and not entry.tried
