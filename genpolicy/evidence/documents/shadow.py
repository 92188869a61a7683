"""`checker.json` (of shadow and of stress) and `mutants.json`: who watches the watchers."""

from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import Discriminator, Tag

from genpolicy.documents.document import Count, Document
from genpolicy.verification.report import JournalReport, Violation

EXECUTION = "execution"
"""What stands for the layer of the executor's own checks."""


@dataclass(frozen=True)
class JournalViolation(Violation):
    """One broken invariant, and the journal that it was found in."""

    journal: str


@dataclass(frozen=True)
class Checked:
    """What the independent checker says of all journals.

    Attributes:
        violations: Of all of them.
        checked_actions: Actions of policies that were accepted.
        reproved_actions: Accepted actions whose motion was proved feasible again.
        journals: What it says of each, by name of the file.
    """

    violations: list[JournalViolation]
    checked_actions: Count
    reproved_actions: Count
    journals: dict[str, JournalReport]


@dataclass(frozen=True)
class LayerMutant:
    """A check of the six layers left out, on its corrupted fixture.

    Attributes:
        check: The check.
        layer: Layer that it belongs to.
        fixture: The corruption.
        behind: Checks that are left out on both sides.
        detected: Whether it was noticed.
        tried: Cases that were broken.
        violations: Of these, those that showed it.
        not_applicable: Why the task has no such fixture; empty where it has.
    """

    check: str
    layer: str
    fixture: str
    behind: list[str]
    detected: bool
    tried: Count
    violations: Count
    not_applicable: str


@dataclass(frozen=True)
class ExecutionMutant:
    """A check of the execution left out, in its scenario.

    Attributes:
        check: The check.
        layer: `EXECUTION`.
        detected: Whether the mutant was found, the unchanged executor was clean, and nothing
            slipped.
        violations: Of the mutant.
        rules: Rules that it broke.
        violations_unchanged: Of the unchanged executor.
        slipped: Actions that were accepted where executor or stub alone was blind to the check,
            beyond those that pass both; 0 where only one of them asks it.
    """

    check: str
    layer: str
    detected: bool
    violations: Count
    rules: list[str]
    violations_unchanged: Count
    slipped: Count


def _kind(row: Any) -> str:
    layer = row.get("layer") if isinstance(row, dict) else getattr(row, "layer", None)
    return (ExecutionMutant if layer == EXECUTION else LayerMutant).__name__


Mutant = Annotated[
    Annotated[LayerMutant, Tag(LayerMutant.__name__)]
    | Annotated[ExecutionMutant, Tag(ExecutionMutant.__name__)],
    Discriminator(_kind),
]
CHECKER = Document("checker.json", Checked)
MUTANTS = Document("mutants.json", list[Mutant])
