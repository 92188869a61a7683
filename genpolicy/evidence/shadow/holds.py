"""What stood still in shadow sessions: holds, doubts about the clock, the watchdog, and stops."""

from collections import Counter
from collections.abc import Iterator, Sequence

from genpolicy.evidence.rows.shadow import ShadowHoldRow
from genpolicy.execution.believed import CLOCK_AHEAD, CLOCK_BACKWARDS, NO_TIME
from genpolicy.execution.journal import Journal
from genpolicy.execution.supervisor import RESET_REFUSED, STOPPED

HOLD, DOUBT, WATCHDOG, STOP = "hold", "doubt", "watchdog", "stop"
DOUBTS = (NO_TIME, CLOCK_BACKWARDS, CLOCK_AHEAD)
"""Why a time is not believed, as `Journal.doubt` says it."""
SILENCE = "silence"


def hold_rows(sessions: Sequence[Journal]) -> list[ShadowHoldRow]:
    """Counts of some sessions, by method, fixture, phase, event and reason, in that order.

    Args:
        sessions: Their journals, with labels `method` and `fixture`.
    """
    counts = Counter(
        (journal.labels["method"], journal.labels["fixture"], *found)
        for journal in sessions
        for found in _still(journal)
    )
    return [ShadowHoldRow(*key, counts[key]) for key in sorted(counts)]


def _still(journal: Journal) -> Iterator[tuple[str, str, str]]:
    """Phase, event and reason of what stood still in one session."""
    phase = ""
    for event in journal.events():
        payload = event.payload
        if event.kind == "phase":
            phase = payload["new"]
        elif event.kind == "hold":
            reason = payload["reason"]
            yield phase, DOUBT if reason in DOUBTS else HOLD, reason
        elif event.kind == "supervisor" and payload["event"] == "watchdog":
            detail = payload["detail"]
            yield phase, WATCHDOG, detail if detail in DOUBTS else SILENCE
        elif event.kind == "supervisor" and payload["event"] == RESET_REFUSED:
            continue  # the stop stood before
        elif event.kind == "supervisor" and payload["state"] in STOPPED:
            yield phase, STOP, payload["event"]
