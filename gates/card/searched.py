"""What the failure search found, for the card: never a criterion, and no part of any decision.

Failures are looked for behind Gate D, on starts that the search chose because they might fail. A
share of failures among them says nothing of how often the policy fails, and nothing that is judged
may read it. What a person who signs should know is where it begins to fail, and how hard anybody
looked.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from gates.words import SHOWN_HASH
from genpolicy.evidence.documents.shadow import CHECKER
from genpolicy.evidence.rows.failures import SearchedRow
from genpolicy.integrity.hashing import sha256_file
from genpolicy.integrity.rows import read_rows

FAILURE_SEARCH = "artifacts/failure_search"
SEARCHED = f"{FAILURE_SEARCH}/searched.parquet"
COUNTED = "found by search; counted in no promotion test"
NOBODY = (
    "No failure was searched for beside the planned rollouts (card.failure_search): nobody knows "
    "where between the planned starts and sizes the candidate begins to fail."
)


@dataclass(frozen=True)
class Found:
    """What came of searching one candidate in one condition.

    Attributes:
        method: The candidate.
        condition: Condition of the plan.
        evaluated: Rollouts that were asked for, all of the budget.
        failed: Of these, without success.
        field: Which of its fields was varied; empty where it has no size.
        most: Largest size that is stated; None without one.
        mildest: The failure at the smallest size, the first of them; None without a failure.
    """

    method: str
    condition: str
    evaluated: int
    failed: int
    field: str
    most: float | None
    mildest: SearchedRow | None


def searched(root: Path) -> list[Found]:
    """What was found, by candidate and condition, in the order of the table; empty without one.

    Raises:
        IntegrityError: Unknown or missing columns.
        BadInputError: The table is truncated or changed.
    """
    path = root / SEARCHED
    if not path.is_file():
        return []
    groups: dict[tuple[str, str], list[SearchedRow]] = {}
    for row in read_rows(path, SearchedRow):
        groups.setdefault((row.method, row.of), []).append(row)
    return [_found(rows) for rows in groups.values()]


def _found(rows: Sequence[SearchedRow]) -> Found:
    first = rows[0]
    failed = [row for row in rows if row.failed]
    mildest = min(failed, key=lambda row: (row.severity or 0.0, row.start), default=None)
    return Found(
        first.method, first.of, len(rows), len(failed), first.field, first.most, mildest
    )  # fmt: skip


def searched_caveats(root: Path, candidate: str) -> tuple[str, ...]:
    """What the card of a candidate says of the search, its table named by hash."""
    own = [found for found in searched(root) if found.method == candidate]
    if not own:
        return (NOBODY,)
    digest = sha256_file(root / SEARCHED)[:SHOWN_HASH]
    evaluated, failed = sum(one.evaluated for one in own), sum(one.failed for one in own)
    return (
        f"Failures {COUNTED}: {candidate} failed in {failed} of {evaluated} rollouts that a search "
        f"asked for ({listed(own)}; {SEARCHED}, SHA-256 {digest}...). They were looked for, so "
        "their share is no rate of failure; where none was found, so many rollouts found none."
        f"{_violations(root)}",
    )


def _violations(root: Path) -> str:
    """What the independent checker found in the searched rollouts; empty where it found nothing."""
    folder = root / FAILURE_SEARCH
    if not (folder / CHECKER.file).is_file():
        return ""
    found = len(CHECKER.read(folder).violations)
    return f" The independent checker found {found} violations in them." if found else ""


def listed(found: Iterable[Found]) -> str:
    """Of each condition how many of how many failed, and the mildest failure."""
    return "; ".join(
        f"{one.condition} {one.failed} of {one.evaluated}{_mildest(one)}" for one in found
    )


def _mildest(found: Found) -> str:
    row = found.mildest
    if row is None:
        return ""
    size = size_of(found)
    at = f" at {size}" if size else ""
    return f", mildest{at}: {row.outcome} at {row.perturbation}/{row.start}"


def size_of(found: Found) -> str:
    """The smallest size at which it failed, beside the largest stated; empty without either."""
    row = found.mildest
    if row is None or row.severity is None or row.most is None:
        return ""
    return f"{found.field} {row.severity:.3g} (stated up to {row.most:g})"
