"""Entries into recovery, written by the rollout's side and derived from events, agree; by hand."""

from dataclasses import asdict
from types import SimpleNamespace

import numpy as np
import pytest

from genpolicy.evidence.shadow.rig import EXECUTION
from genpolicy.evidence.stress.recoveries import recovery_rows
from genpolicy.evidence.stress.state import Outcome
from genpolicy.execution.journal import Journal, encode_actions, write_journal
from genpolicy.execution.recovery import Recovery
from genpolicy.verification.rollouts import derived_with_recoveries

STILL = [0.4, 0.1, 0.2, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.03]
"""A pose with the hand upright."""


def beside(**changes):
    """A command, as journals write it, with some numbers moved; by their place."""
    values = np.array(STILL)
    for place, by in changes.items():
        values[int(place[1:])] += by
    return encode_actions(values)


HELD, MOVED = beside(), beside(_2=0.05)
HAND_BACK = ("retreat", "return", "reach")
SHARD = SimpleNamespace(judged=SimpleNamespace(name="flow", seed=0), perturbation="drill")


class Session:
    """A session whose steps are words."""

    def __init__(self):
        self.journal = Journal(
            "flow/drill/3", {"method": "flow", "perturbation": "drill", "start": "3"}
        )
        self.recovery = Recovery(EXECUTION, self.journal)
        self.now_s = 0.0
        payload = {"labels": self.journal.labels, "period_ns": 50_000_000}
        self.journal.add("session", 0, payload)

    def do(self, word):
        self.now_s += 1.0
        kind, _, rest = word.partition(":")
        if kind == "enter":
            self.recovery.trigger(self.now_s, rest, "silence")
        elif kind == "advance":
            self.recovery.advance(self.now_s)
        elif kind == "reach":
            self.recovery.primitive_succeeded(self.now_s)
        elif kind == "fail":
            self.recovery.primitive_failed(self.now_s, rest)
        elif kind == "stop":
            self.recovery.stop(self.now_s, "force")
        elif kind == "feel":
            self.recovery.feel(self.now_s, float(rest))
        else:
            action = {"held": HELD, "moved": MOVED}.get(rest, rest)
            payload = {"action": action, "age_ns": 1}
            self.journal.add(kind, self.journal.clock(self.now_s), payload)


def told(tmp_path, words, outcome=Outcome.SUCCESS):
    """Rows of a session, which both sides must give alike, and its rollout's columns."""
    session = Session()
    for word in words:
        session.do(word)
    now_ns = session.journal.clock(session.now_s + 1.0)
    session.journal.add("outcome", now_ns, {"outcome": str(outcome), "mode": "left"})
    session.journal.add("end", now_ns, {})
    path = tmp_path / "journal.mcap"
    write_journal(path, [session.journal])
    rollout = SimpleNamespace(journal=session.journal, outcome=outcome, start_index=3)
    written = [asdict(row) for row in recovery_rows(SHARD, rollout)]
    rollouts, derived = derived_with_recoveries(path)
    assert [{**row, "seed": 0} for row in derived] == written
    (columns,) = rollouts.values()
    assert columns["recovery_attempted"] is bool(written)
    assert columns["recovered"] is (bool(written) and written[-1]["recovered"])
    return written


BEGIN = ("accept:held", "enter:insert", "advance", "fallback:moved")


def test_a_recovery_whose_primitives_move_the_arm_and_whose_policy_goes_on(tmp_path):
    (row,) = told(tmp_path, (*BEGIN, "feel:3", "feel:2", "reach", "reach", "accept:moved"))
    assert row["recovered"] is True and row["ended"] == "handed_back"
    assert (row["phase"], row["cause"], row["recovery"]) == ("insert", "silence", 0)
    assert (row["primitives"], row["failures"]) == ("retreat classical_return", 0)
    assert (row["duration_s"], row["force_peak_n"], row["resets"]) == (6.0, 3.0, 0)


@pytest.mark.parametrize(
    ("words", "outcome", "expected"),
    [
        # The primitives had nothing to do: what helped can only have been the next sample.
        (("accept:held", "enter:insert", "advance", "reach", "reach", "accept:moved"),
         Outcome.SUCCESS, {"resampled_only": True, "ended": "handed_back", "succeeded": True}),
        (("accept:held", "enter:insert", "advance", "fallback:held", "reach", "reach",
          "accept:moved"), Outcome.SUCCESS, {"resampled_only": True}),
        # Before the first command nobody knows what was held: one row is no motion.
        (("enter:insert", "advance", "fallback:moved", "reach", "reach", "accept:moved"),
         Outcome.SUCCESS, {"resampled_only": True}),
        # What the policy commanded meanwhile is no motion of a primitive.
        (("accept:held", "enter:insert", "advance", "accept:moved", "reach", "reach",
          "accept:moved"), Outcome.SUCCESS, {"resampled_only": True}),
        # Nor is what is driven while it holds, before any.
        (("accept:held", "enter:insert", "fallback:moved", "advance", "reach", "reach",
          "accept:moved"), Outcome.SUCCESS, {"resampled_only": True}),
        # Success without one action of the policy is the fallback's.
        ((*BEGIN, "reach", "reach"), Outcome.SUCCESS, {"taken_over": False, "succeeded": True}),
        ((*BEGIN, "reach", "reach", "accept:held"), Outcome.TIMEOUT,
         {"taken_over": True, "succeeded": False}),
        ((*BEGIN, "fail:timeout", "advance", "fail:timeout", "advance", "fail:timeout"),
         Outcome.INTERVENTION, {"ended": "timed_out", "failures": 3,
                                "primitives": "retreat retreat retreat"}),
        ((*BEGIN, *("fail:fallback rejected", "advance") * 2, "fail:fallback rejected"),
         Outcome.INTERVENTION, {"ended": "refused", "failures": 3}),
        ((*BEGIN, "stop"), Outcome.FORCE_STOP, {"ended": "stopped", "resets": 1}),
        (BEGIN, Outcome.TIMEOUT, {"ended": "episode_over", "duration_s": 3.0}),
        (("enter:release", "advance"), Outcome.INTERVENTION,
         {"ended": "person", "primitives": "", "duration_s": 1.0}),
    ],
)  # fmt: skip
def test_what_counts_as_not_recovered(tmp_path, words, outcome, expected):
    (row,) = told(tmp_path, words, outcome)
    assert row["recovered"] is False
    assert {name: row[name] for name in expected} == expected


@pytest.mark.parametrize(
    ("action", "moves"),
    [
        (beside(_0=0.0009), False), (beside(_0=0.0008, _1=0.0008), True), (beside(_2=0.0011), True),
        # Two tenths of a degree are the pose that was held; a degree is not.
        (beside(_5=0.0033), False), (beside(_5=0.008, _6=0.008), True), (beside(_3=-0.011), True),
        (beside(_9=0.0009), False), (beside(_9=-0.0011), True),
    ],
)  # fmt: skip
def test_a_command_within_a_millimetre_of_the_held_one_moves_nothing(tmp_path, action, moves):
    words = ("accept:held", "enter:insert", "advance", f"fallback:{action}", "reach", "reach",
             "accept:moved")  # fmt: skip
    (row,) = told(tmp_path, words)
    assert (row["resampled_only"], row["recovered"]) == (not moves, moves)


def test_a_phase_that_had_to_be_recovered_again_was_not_recovered_before(tmp_path):
    once = ("fallback:held", "feel:5", "reach", "reach", "accept:moved")
    rows = told(tmp_path, (*BEGIN, *once, "enter:insert", "advance", *once))
    assert [row["recovered"] for row in rows] == [False, True]
    assert [row["force_peak_n"] for row in rows] == [5.0, 5.0]
    rows = told(tmp_path, (*BEGIN, *once, "enter:approach", "advance", "fallback:held", "reach",
                           "accept:moved"))  # fmt: skip
    assert [row["recovered"] for row in rows] == [True, True]
    assert [row["recovery"] for row in rows] == [0, 1]


def test_a_stop_from_idle_is_no_entry_and_no_force_is_felt_outside(tmp_path):
    assert told(tmp_path, ("accept:held", "feel:9", "stop"), Outcome.FORCE_STOP) == []
    (row,) = told(tmp_path, (*BEGIN, "reach", "reach", "feel:9", "accept:moved"))
    assert row["force_peak_n"] == 0.0
