"""The document of the independent checker, made again from the journals that it is of."""

from collections.abc import Sequence
from pathlib import Path

from gates.report import Gate
from gates.stated import compare_keys, refuse
from genpolicy.evidence.documents.shadow import CHECKER
from genpolicy.evidence.shadow.tables import checked
from genpolicy.verification.checker import check_journal
from genpolicy.verification.expected import ExpectedSettings
from genpolicy.verification.motion import ExpectedMotion
from genpolicy.verification.report import JournalReport

AGAIN = "as checked again"


def rederive_checked(
    root: Path,
    gate: Gate,
    folder: str,
    held_to: tuple[ExpectedSettings, ExpectedMotion],
    journals: Sequence[Path],
) -> None:
    """Hold what a stage says that the checker found against what it finds now.

    Args:
        root: Root of the workspace.
        gate: Whose evidence it is.
        folder: Where the document lies, from the root.
        held_to: What every session must have declared, and what every executed row must keep to.
        journals: All of which the document is.

    Raises:
        RefusedError: It has another finding, a journal too few or one too many.
        IntegrityError: A file is missing or no regular file.
        BadInputError: A file cannot be read.
    """
    again = checked({path.name: check_journal(path, *held_to).as_document() for path in journals})
    stated, path = CHECKER.read(root / folder), f"{folder}/{CHECKER.file}"
    for name in sorted({*again.journals, *stated.journals}):
        claimed, found = stated.journals.get(name), again.journals.get(name)
        if claimed != found:
            refuse(gate, f"{path}: {name}", _totals(claimed), f"{_totals(found)}, {AGAIN}")
    compare_keys(gate, path, CHECKER.plain(stated), CHECKER.plain(again), AGAIN)


def _totals(report: JournalReport | None) -> str:
    if report is None:
        return "nothing"
    return f"{len(report.violations)} violations in {report.checked_actions} actions"
