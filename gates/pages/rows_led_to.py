"""What a row leads to: its rollout, its session, or their journal, in a last column."""

from collections.abc import Collection

import pyarrow as pa

from gates.feasibility.settings import SHADOW
from gates.stress.rollouts import STRESS

ROLLOUT = ("method", "perturbation", "start")
SESSION = ("method", "fixture", "observation")
"""What names a rollout of Gate D and a session of the shadow test, in the order of its name."""
ALL = "*"
"""In place of what a row adds up over."""
SHADOW_JOURNAL = f"{SHADOW}/journal.mcap"


def led_to(path: str, table: pa.Table, played: Collection[str]) -> pa.Table:
    """The table with the names of what its rows are of, where that can be opened.

    A row of one rollout names it, one of one session too; one that adds up over starts names the
    journal that holds them, one over observations its sessions: `flow/held_out/*`.

    Args:
        path: Of the table.
        table: Without columns that hold lists.
        played: Journals that are evidence; what lies in another is not named.
    """
    names = set(table.column_names)
    if path.startswith(f"{STRESS}/") and set(ROLLOUT[:2]) <= names:
        each = set(ROLLOUT) <= names
        found = [
            ("/".join(map(str, row)) if each else journal)
            if (journal := f"{STRESS}/journals/{row[0]}__{row[1]}.mcap") in played
            else ""
            for row in _rows(table, ROLLOUT if each else ROLLOUT[:2])
        ]
        return table.append_column("rollout" if each else "journal", pa.array(found, pa.string()))
    if path.startswith(f"{SHADOW}/") and set(SESSION[:2]) <= names:
        each, opened = set(SESSION) <= names, SHADOW_JOURNAL in played
        found = [
            "/".join(map(str, row if each else (*row, ALL))) if opened else ""
            for row in _rows(table, SESSION if each else SESSION[:2])
        ]
        return table.append_column("session" if each else "sessions", pa.array(found, pa.string()))
    return table


def _rows(table: pa.Table, names: Collection[str]) -> list[tuple[object, ...]]:
    return list(zip(*(table.column(name).to_pylist() for name in names), strict=True))
