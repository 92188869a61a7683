"""Looks at chance: starts that decide alone, states that repeat."""

import evidence
import pytest
from causes_planted import FLOW, of_flow

from gates.diagnosis.looking import Look
from gates.diagnosis.of_seeds import noise_and_starts


def value(look, what):
    return next(one.value for one in look.numbers if one.what == what)


@pytest.fixture
def looked(planted):
    """What is seen of the starts after an edit of the rollouts."""

    def look_after(change) -> Look:
        look = Look(planted(lambda root: evidence.edit_table(
            root, "stress/rollouts.parquet", change), ""), FLOW)  # fmt: skip
        noise_and_starts(look)
        return look

    return look_after


def test_starts_that_fail_everywhere_and_that_succeed_everywhere_are_counted(looked):
    """Three starts fail in every condition and four in one; all others succeed in every one."""

    def change(frame):
        mine, ended = of_flow(frame), {True: "success", False: "failed"}
        lost = frame["start"] < 3
        lost |= (frame["start"] < 7) & (frame["perturbation"] == "nominal")
        won = frame["success"].mask(mine, ~lost)
        return frame.assign(success=won, outcome=frame["outcome"].mask(mine, won.map(ended)))

    look = looked(change)
    said = value(look, "starts that fail in every condition, and that succeed in every one")
    assert said == f"3 and {evidence.STARTS - 7}"
    assert look.causes == []


def test_starts_of_one_state_are_a_cause(looked):
    def change(frame):
        second = of_flow(frame) & (frame["start"] == 1) & (frame["perturbation"] == "nominal")
        first = of_flow(frame) & (frame["start"] == 0) & (frame["perturbation"] == "nominal")
        state = frame.loc[first, "start_sha256"].iloc[0]
        return frame.assign(start_sha256=frame["start_sha256"].mask(second, state))

    (cause,) = looked(change).causes
    states = evidence.STARTS - 1
    assert cause == f"starts repeat: {evidence.STARTS} of them begin in {states} states."
