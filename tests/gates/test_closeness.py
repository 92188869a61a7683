"""How near a number is to its limit: formulas by hand, and where nothing can be said."""

import pytest

from gates.closeness import NEAR, by_room, closeness
from gates.report import Answer


def answer(measured, threshold, comparison="<=", *, interval=None, verdict="PASS", **more):
    fields = {
        "id": "some_share", "question": "Is it so?", "owner": "model", "candidate": None,
        "reason": "because", "evidence": (), "caveat": "", "counted": "",
    }  # fmt: skip
    return Answer(
        **{**fields, **more},
        measured=measured, threshold=threshold, comparison=comparison, interval=interval,
        verdict=verdict,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("found", "limit", "comparison", "used"),
    [
        (0.3, 0.5, "<=", 0.6),
        (0.5, 0.5, "<=", 1.0),
        (-0.2, 0.5, "<=", 0.0),  # a share of guesses less what chance tells
        (0.8, 0.6, ">=", 0.75),
        (120.0, 30.0, ">=", 0.25),
        (30.0, 30.0, ">=", 1.0),  # just as many as are needed
    ],
)
def test_the_share_of_the_limit_is_that_of_the_formula(found, limit, comparison, used):
    near = closeness(answer(found, limit, comparison))
    assert near is not None and near.used == pytest.approx(used) and not near.worse_end


@pytest.mark.parametrize(
    "nothing",
    [
        answer(0.0, 0.0),
        answer(1.0, 1.0, ">="),
        answer(None, 0.5, verdict="INCONCLUSIVE"),
        answer(0.4, None, verdict="INCONCLUSIVE"),
        answer(None, 0.5),  # a report that says so is shown before it is refused
        answer(0.4, None),
        answer(0.6, 0.5, verdict="FAIL"),
        answer(0.6, 0.5, interval=(0.4, 0.6), verdict="INCONCLUSIVE"),
    ],
)
def test_what_is_kept_or_broken_or_open_has_no_room(nothing):
    assert closeness(nothing) is None


def test_an_interval_that_ends_at_its_limit_has_no_room_left():
    near = closeness(answer(0.5, 0.5, ">=", interval=(0.5, 0.7)))
    assert near is not None and near.used == 1.0 and near.worse_end and near.near


def test_near_begins_at_nine_tenths():
    assert closeness(answer(NEAR, 1.0)).near and not closeness(answer(NEAR - 1e-9, 1.0)).near


def test_the_nearest_comes_first_and_equals_keep_their_order():
    rows = [answer(0.1, 1.0, id="a"), answer(0.9, 1.0, id="b"), answer(0.9, 1.0, id="c")]
    assert [near.answer.id for near in by_room([*rows, answer(0.0, 0.0)])] == ["b", "c", "a"]
