"""Holds, doubts, watchdog and stops: every one on record is counted once, where it happened."""

import math
from collections import Counter

import pytest

from genpolicy.evidence.rows.shadow import ShadowHoldRow
from genpolicy.evidence.shadow.holds import DOUBTS, hold_rows
from genpolicy.evidence.shadow.rig import PERIOD_S, Rig
from genpolicy.execution.journal import Journal, write_journal
from genpolicy.verification.shadow import derived_shadow

LABELS = {"method": "flow", "fixture": "held_out", "observation": "0"}


def session(name="flow/held_out/0", **labels):
    journal = Journal(name, {**LABELS, **labels})
    journal.add("session", 0, {"version": 6, "labels": journal.labels})
    return journal


def phase(journal, name):
    journal.add("phase", 0, {"event_time_ns": 0, "old": "", "new": name})


def hold(journal, reason):
    journal.add("hold", 0, {"reason": reason})


def supervisor(journal, event, state, detail=""):
    journal.add("supervisor", 0, {"event": event, "state": state, "detail": detail})


@pytest.fixture
def sessions():
    first, second, other = session(), session("flow/held_out/1"), session("x", fixture="stop")
    phase(first, "approach")
    hold(first, "empty")
    hold(first, "empty")
    phase(first, "insert")
    hold(first, "empty")
    hold(first, "clock_ahead")
    supervisor(first, "watchdog", "watchdog_hold", "150000000 ns")
    supervisor(first, "watchdog_recovered", "run")
    phase(second, "approach")
    hold(second, "empty")
    supervisor(second, "watchdog", "watchdog_hold", "clock_ahead")
    hold(other, "stopped")
    supervisor(other, "force", "protective_stop", "90 N")
    supervisor(other, "emergency_stop", "emergency_stop")
    supervisor(other, "reset_refused", "emergency_stop", "no_time, no time, by Ann")
    supervisor(other, "human_reset", "run", "spotter")
    return [first, second, other]


def test_each_is_counted_where_it_happened(sessions):
    """Golden: by hand."""
    own, stop = ("flow", "held_out"), ("flow", "stop")
    assert hold_rows(sessions) == [
        ShadowHoldRow(*own, "approach", "hold", "empty", 3),
        ShadowHoldRow(*own, "approach", "watchdog", "clock_ahead", 1),
        ShadowHoldRow(*own, "insert", "doubt", "clock_ahead", 1),
        ShadowHoldRow(*own, "insert", "hold", "empty", 1),
        ShadowHoldRow(*own, "insert", "watchdog", "silence", 1),
        ShadowHoldRow(*stop, "", "hold", "stopped", 1),
        ShadowHoldRow(*stop, "", "stop", "emergency_stop", 1),
        ShadowHoldRow(*stop, "", "stop", "force", 1),
    ]


def test_the_order_of_sessions_is_no_matter(sessions):
    assert hold_rows(sessions[::-1]) == hold_rows(sessions)
    assert hold_rows([]) == []


def test_the_journal_says_the_same_to_who_reads_it_alone(sessions, tmp_path):
    """Two witnesses: rows from the objects, and from the file."""
    write_journal(tmp_path / "journal.mcap", sessions)
    found = derived_shadow(tmp_path / "journal.mcap")["holds"]
    assert found == [vars_of(row) for row in hold_rows(sessions)]


def vars_of(row):
    return {name: getattr(row, name) for name in ShadowHoldRow.__dataclass_fields__}


def test_every_doubt_of_a_clock_has_its_name():
    """Whatever a journal doubts is a doubt here, and nothing else is."""
    rig = Rig(session="s")
    rig.observe()
    for time_s, why in ((math.nan, "no_time"), (-1.0, "clock_backwards"), (9e5, "clock_ahead")):
        rig.executor.tick(time_s)
        assert rig.journal.doubt == why
    rig.journal.labels |= LABELS
    counted = {row.reason: row.count for row in hold_rows([rig.journal]) if row.event == "doubt"}
    assert counted == dict.fromkeys(DOUBTS, 1)


def test_every_hold_and_every_event_of_the_supervisor_is_counted():
    """Conservation: as many as on record, in a session with chunks, silence and a stop."""
    rig = Rig(session="s")
    for _ in range(3):
        rig.run()
    rig.tick(8)
    rig.executor.tick(rig.now_s - 10 * PERIOD_S)
    rig.supervisor.emergency_stop(rig.now_s)
    rig.tick(3)
    rig.end()
    rig.journal.labels |= LABELS
    found = Counter()
    for row in hold_rows([rig.journal]):
        found[row.event] += row.count
    events = rig.journal.events()
    holds = [event for event in events if event.kind == "hold"]
    assert found["hold"] + found["doubt"] == len(holds) > 5
    assert found["doubt"] == rig.journal.doubts == 1
    told = Counter(event.payload["event"] for event in events if event.kind == "supervisor")
    assert found["watchdog"] == told["watchdog"] >= 1
    assert found["stop"] == told["emergency_stop"] == 1
