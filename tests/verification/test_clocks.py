"""Rows of a window from raw events."""

import pytest

from genpolicy.errors import BadInputError
from genpolicy.execution.journal import Journal, write_journal
from genpolicy.verification.clocks import derived_windows

PERIOD_NS, DEADLINE_S = 50_000_000, 0.15
LABELS = {"method": "flow", "episode": "e1"}


@pytest.fixture
def told(tmp_path):
    """What is derived of a journal of some events."""

    def derive(*events, clock="wall"):
        journal = Journal("flow/wall_clock/0", LABELS)
        journal.add("session", 0, {"labels": LABELS, "period_ns": PERIOD_NS})
        for kind, at_ns, payload in events:
            journal.add(kind, at_ns, payload)
        path = tmp_path / f"flow__{clock}.mcap"
        write_journal(path, [journal])
        return derived_windows([path], deadline_s=DEADLINE_S)

    return derive


def begin(name, at_ns):
    return "invocation", at_ns, {"id": name, "stage": "begin", "detail": ""}


def end(name, at_ns, how):
    return "invocation", at_ns, {"id": name, "stage": "end", "detail": how}


def gone(name, at_ns, ended, reason):
    return "discard", at_ns, {"chunk_id": name, "ended": ended, "reason": reason}


def test_an_invocation_that_missed_its_deadline_and_one_that_gave_way(told):
    found = told(
        begin("a", 0), end("a", 150_000_000, "deadline"),
        gone("a", 150_000_000, "discarded", "expired"),
        begin("b", 200_000_000), end("b", 210_000_000, "answered"),
        ("accept", 250_000_000, {"chunk_id": "b", "row": 1, "age_ns": 50_000_000}),
        gone("b", 300_000_000, "executed", "superseded"),
        begin("c", 300_000_000),
        ("end", 350_000_000, {}),
    )  # fmt: skip
    key = {"method": "flow", "clock": "wall", "episode": "e1"}
    assert found.invocations == [
        key | {"invocation": 0, "in_time": True, "missed": True, "discarded_by": "expired",
               "replaced": False},
        key | {"invocation": 1, "in_time": False, "missed": False, "discarded_by": "",
               "replaced": True},
        key | {"invocation": 2, "in_time": False, "missed": False, "discarded_by": "",
               "replaced": False},
    ]  # fmt: skip
    assert found.ages == [key | {"invocation": 1, "row": 1, "age_s": 0.05}]


@pytest.mark.parametrize("reason", ["reset", "stopped", "stale_observation", "end_of_episode"])
def test_a_rest_that_ends_before_another_chunk_is_there_is_not_replaced(reason, told):
    (row,) = told(begin("a", 0), gone("a", 1, "executed", reason), ("end", 1, {})).invocations
    assert (row["discarded_by"], row["replaced"]) == ("", False)


def test_an_invocation_counts_if_its_deadline_and_a_tick_lie_within_the_window(told):
    at_ns = round(DEADLINE_S * 1e9) + PERIOD_NS
    for end_ns, in_time in ((at_ns, True), (at_ns - 1, False)):
        assert told(begin("a", 0), ("end", end_ns, {})).invocations[0]["in_time"] is in_time


def test_a_chunk_of_which_a_row_moved_and_that_ends_by_itself_gave_way_to_nobody(told):
    ended = ("finish", 1, {"chunk_id": "a", "ended": "executed"})
    (row,) = told(begin("a", 0), ended, ("end", 1, {})).invocations
    assert (row["discarded_by"], row["replaced"]) == ("", False)
    lost = ("finish", 1, {"chunk_id": "a", "ended": "discarded"})
    (row,) = told(begin("a", 0), lost, ("end", 1, {})).invocations
    assert row["discarded_by"] == "expired"


def test_a_tick_lies_beside_its_period_by_less_than_half_of_one(told):
    seen = [("observation", at_ns, {}) for at_ns in (0, 50_000_000, 50_000_000, 103_000_000,
                                                     149_000_000)]  # fmt: skip
    (row,) = told(*seen, ("end", 200_000_000, {}), clock="virtual").ticks
    assert (row["clock"], row["ticks"], row["late_max_s"]) == ("virtual", 4, 0.003)


def test_a_chunk_of_no_invocation_is_bad_input(told):
    with pytest.raises((BadInputError, KeyError)):
        told(gone("nobody", 1, "discarded", "expired"))
