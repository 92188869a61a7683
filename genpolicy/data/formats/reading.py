"""Which columns of a table are read: those that the contract names, and what was recorded beside.

What is read beside must refuse no episode and fill no memory: nothing depends on it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

from genpolicy.data.formats.source import TOO_LARGE, Also, Budget, bytes_of
from genpolicy.data.formats.tables import Table


@dataclass(frozen=True)
class Reading:
    """Columns of one table.

    Attributes:
        names: All that are read.
        beside: Those of them that nothing depends on.
        left: What is not read although it might be a reason, and why.
    """

    names: list[str]
    beside: frozenset[str] = frozenset()
    left: dict[str, str] = field(default_factory=dict)


def reading(table: Table, needed: Sequence[str], also: Also, *, rows: int) -> Reading:
    """What to read of a table.

    Args:
        table: The table.
        needed: Columns of the contract and of the layout.
        also: Says which others.
        rows: Rows of its longest episode.
    """
    names = list(dict.fromkeys(needed))
    more = [c for c in table.columns.values() if c.name not in names and also(c)]
    budget = Budget()
    # The smallest first, so that as many as can be are read.
    ranked = sorted(more, key=lambda column: (bytes_of(column, rows), column.name))
    left = {c.name: TOO_LARGE for c in ranked if not budget.takes(bytes_of(c, rows))}
    beside = [c.name for c in more if c.name not in left]
    return Reading([*names, *beside], frozenset(beside), left)
