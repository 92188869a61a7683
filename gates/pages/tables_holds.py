"""Table of Gate C: when nothing was commanded, and why; holds, doubts, the watchdog, and stops."""

from collections.abc import Iterable
from functools import partial
from typing import Literal

import pandas as pd

from gates.evidence import Evidence, counts
from gates.feasibility.settings import HELD_OUT, SHADOW
from gates.pages.bound import require_bound
from gates.pages.figures import Folded, Listing, Table, in_order
from gates.pages.reasons import said
from gates.report import GateReport
from genpolicy.evidence.rows.shadow import ShadowHoldRow

FILE = f"{SHADOW}/holds.parquet"
EVENTS = ("hold", "doubt", "watchdog", "stop")
"""What is counted, the most usual first; one that never happened is said to have not."""
MOST_NAMED = 4
"""Values that a line names; the others are in the folded tables."""


def _held(evidence: Evidence, report: GateReport) -> pd.DataFrame:
    require_bound(evidence, report, FILE)
    frame = evidence.rows(FILE, ShadowHoldRow)
    return frame.assign(count=counts(frame, "count"))


def _groups(frame: pd.DataFrame) -> Iterable[tuple[str, str, str, pd.DataFrame]]:
    """Event, reason, method and its rows; of an event the most frequent reason first."""
    for event in [*EVENTS, *sorted(set(frame["event"]) - set(EVENTS))]:
        of_event = frame[frame["event"] == event]
        often = of_event.groupby("reason")["count"].sum()
        for reason in sorted(often.index, key=lambda name: (-often[name], str(name))):
            of_reason = of_event[of_event["reason"] == reason]
            for method in in_order(of_reason["method"]):
                yield event, reason, method, of_reason[of_reason["method"] == method]


def _most(rows: pd.DataFrame, column: str) -> str:
    """How often for each value of a column, most first, and how many values are not named."""
    often = rows.groupby(column)["count"].sum()
    names = sorted(often.index, key=lambda name: (-often[name], str(name)))
    text = ", ".join(f"{said(str(name))} {often[name]:g}" for name in names[:MOST_NAMED])
    rest = len(names) - MOST_NAMED
    return text + (f", and {rest} more" if rest > 0 else "")


def _listed(evidence: Evidence, report: GateReport) -> Table:
    frame = _held(evidence, report)
    lines = [
        (f"{event}: {said(reason)}", method, f"{rows['count'].sum():g}", _most(rows, "phase"),
         _most(rows, "fixture"))
        for event, reason, method, rows in _groups(frame)
    ]  # fmt: skip
    never = [(event, "all", "0", "", "") for event in EVENTS if event not in set(frame["event"])]
    return (("what: why", "method", "how often", "by phase", "by condition"), *lines, *never)


def _each(
    evidence: Evidence, report: GateReport, *, column: Literal["fixture", "phase"], head: str
) -> Table:
    """One line for each value of a column at which something stood still; held-out data first."""
    lines = [
        (event, said(reason), method, said(str(name)), f"{count:g}")
        for event, reason, method, rows in _groups(_held(evidence, report))
        for name, count in sorted(
            rows.groupby(column)["count"].sum().items(), key=lambda pair: pair[0] != HELD_OUT
        )
    ]
    return (("what", "why", "method", head, "how often"), *lines)


LISTINGS = (
    Listing(
        "When nothing was commanded",
        "Ticks of the shadow sessions that held, by reason; of these as doubts those whose time "
        "was not believed; how often the watchdog began to hold after a silence; and stops of the "
        "supervisor. Nothing here is a fault by itself: a session ticks on behind its one chunk, "
        "so that each ends with empty queues and a silence, and conditions are meant to stop. "
        "Look for what has no such cause: a doubt where no clock was stepped, a stop where nothing "
        "was injected, a hold in the middle of a chunk on held-out observations. What happens in "
        "closed loop is counted by Gate D. Derived again from the journal by genpolicy verify "
        "report.",
        FILE,
        _listed,
        folded=(
            Folded("Every condition", partial(_each, column="fixture", head="condition")),
            Folded("Every phase", partial(_each, column="phase", head="phase")),
        ),
    ),
)
