"""A silence that stops is seen where nothing stopped, whatever comes behind it."""

import pytest

from genpolicy.verification.silence import RULE, Silence

LIMIT_S = 1e-7  # 100 ns
STOP, CLEARED = ("silence", "protective_stop"), ("human_reset", "run")


def found(*events, limit_s=LIMIT_S):
    """Rules broken by each event, behind an action at 0."""
    silence, rules = Silence(limit_s), []
    assert not list(silence.follow("accept", {"t": 0}))
    for kind, t, *what in events:
        names = ("event", "state") if kind == "supervisor" else ("reason",)
        m = {"t": t, **dict(zip(names, what, strict=False))}
        rules.append([rule for rule, _ in silence.follow(kind, m)])
    return rules


@pytest.mark.parametrize(("t", "broken"), [(100, []), (101, [RULE])])
@pytest.mark.parametrize("kind", ["accept", "fallback", "hold"])
def test_longer_than_the_limit_and_no_stop(kind, t, broken):
    assert found((kind, t, "empty")) == [broken]
    assert found((kind, t, "empty"), limit_s=None) == [[]]
    assert found(("accept", 90), (kind, 90 + t, "empty")) == [[], broken]


def test_a_stop_and_who_clears_it_begin_anew():
    stopped = ("supervisor", 101, *STOP)
    assert found(stopped, ("hold", 110, "stopped"), ("hold", 900, "stopped")) == [[]] * 3
    cleared = ("supervisor", 300, *CLEARED)
    assert found(stopped, cleared, ("accept", 900), ("accept", 1001)) == [[], [], [], [RULE]]


def test_a_reset_that_clears_no_stop_ends_no_silence():
    held = ("supervisor", 50, "watchdog", "watchdog_hold")
    assert found(held, ("supervisor", 60, *CLEARED), ("accept", 101)) == [[], [], [RULE]]
    refused = ("supervisor", 60, "reset_refused", "protective_stop")
    stopped = ("supervisor", 50, *STOP)
    assert found(stopped, refused, ("accept", 900)) == [[], [], []], "that is P7.stop"


@pytest.mark.parametrize(
    ("reason", "broken"), [("no_time", []), ("clock_backwards", []), ("clock_ahead", [RULE])]
)
def test_a_clock_far_ahead_is_a_silence_and_another_doubt_measures_none(reason, broken):
    assert found(("hold", 5, reason)) == found(("hold", 500, reason)) == [broken]
    assert found(("supervisor", 5, *STOP), ("hold", 5, reason)) == [[], []]
    before = Silence(LIMIT_S)
    assert not list(before.follow("hold", {"t": 5, "reason": reason})), "nobody commanded yet"


def test_what_is_nothing_of_the_kind_is_passed_by():
    assert found(("observation", 900), ("enqueue", 900)) == [[], []]
