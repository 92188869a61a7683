"""How near a number is to its limit: formulas by hand, and where nothing can be said."""

import math

import numpy as np
import pytest

from gates.closeness import NEAR, by_room, closeness
from gates.report import Answer
from genpolicy.statistics.intervals import clopper_pearson


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
    ("found", "limit", "comparison", "used", "name"),
    [
        (0.3, 0.5, "<=", 0.6, "some_share"),
        (0.5, 0.5, "<=", 1.0, "some_share"),
        (-0.2, 0.5, "<=", 0.0, "told_share"),  # a share of guesses less what chance tells
        (0.8, 0.6, ">=", 0.5, "some_share"),  # 20 of the 40 points that may be missing
        (359 / 360, 0.9, ">=", 10 / 360, "some_share"),  # one of the 36 that may fail
        (1.0, 0.9, ">=", 0.0, "some_share"),  # all of a share: the whole room is left
        (120.0, 30.0, ">=", 0.25, "situations"),
        (30.0, 30.0, ">=", 1.0, "situations"),  # just as many as are needed
        (1.0, 1.5, "<=", 0.0, "latency_ratio_upper"),  # as long as before
        (1.25, 1.5, "<=", 0.5, "latency_ratio_upper"),
        (0.8, 1.5, "<=", 0.0, "latency_ratio_upper"),  # shorter than before
        (400.0, 20.0, ">=", 0.5, "promotion_e_value"),  # as evidence multiplies
        (20.0, 20.0, ">=", 1.0, "promotion_e_value"),
    ],
)
def test_the_share_of_the_room_is_that_of_the_formula(found, limit, comparison, used, name):
    near = closeness(answer(found, limit, comparison, id=name))
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
        answer(0.0, 4.0, ">=", verdict="PENDING_REVIEW"),  # waits for people, and is not broken
    ],
)
def test_what_has_no_number_no_limit_or_is_kept_exactly_has_no_room(nothing):
    assert closeness(nothing) is None


@pytest.mark.parametrize(
    "unmet",
    [
        answer(0.6, 0.5, verdict="FAIL"),
        answer(2.0, 0.0, verdict="FAIL"),  # a limit of none, broken
        answer(0.0, 1.0, ">=", verdict="FAIL"),
        answer(0.6, 0.5, interval=(0.4, 0.6), verdict="INCONCLUSIVE"),
    ],
)
def test_what_does_not_hold_has_a_full_bar_and_is_not_merely_near(unmet):
    near = closeness(unmet)
    assert near is not None and near.used == 1.0 and not near.holds and not near.near


def test_an_interval_that_ends_at_its_limit_has_no_room_left():
    near = closeness(answer(0.5, 0.5, ">=", interval=(0.5, 0.7)))
    assert near is not None and near.used == 1.0 and near.worse_end and near.near


def test_near_begins_at_nine_tenths_of_the_room():
    assert closeness(answer(NEAR, 1.0)).near and not closeness(answer(NEAR - 1e-9, 1.0)).near


def test_all_but_one_of_many_is_not_near_what_nine_tenths_must_meet():
    """A tenth may fail and one of 360 did."""
    assert not closeness(answer(359 / 360, 0.9, ">=")).near


@pytest.mark.parametrize(("end", "near"), [(0.299, False), (0.301, True)])
def test_near_is_also_what_lies_less_than_half_its_interval_from_the_limit(end, near):
    """0.2 wide, limit 0.4: half of it away is 0.3."""
    found = closeness(answer(end, 0.4, interval=(end - 0.2, end)))
    assert (found.near, found.chance) == (near, near) and found.used < NEAR


def test_another_draw_breaks_what_is_near_by_chance_in_one_of_ten_or_more():
    """By simulation: a truth like the share that was seen, and 100 units in each draw."""
    low, high = clopper_pearson(20, 100, 0.95)
    limit = high + 0.499 * (high - low)
    assert closeness(answer(high, limit, interval=(low, high))).chance
    rng = np.random.default_rng(0)
    truth = rng.beta(20.5, 80.5, 4000)
    ends = {k: clopper_pearson(int(k), 100, 0.95)[1] for k in range(101)}
    broken = np.mean([ends[int(k)] > limit for k in rng.binomial(100, truth)])
    assert 0.05 < broken < 0.15 and math.isfinite(broken)


def test_what_does_not_hold_comes_first_then_the_nearest_and_equals_keep_their_order():
    rows = [
        answer(0.1, 1.0, id="a"),
        answer(0.9, 1.0, id="b"),
        answer(0.9, 1.0, id="c"),
        answer(1.1, 1.0, id="open", interval=(0.9, 1.1), verdict="INCONCLUSIVE"),
        answer(1.1, 1.0, id="broken", verdict="FAIL"),
        answer(0.0, 0.0),
    ]
    order = ["broken", "open", "b", "c", "a"]
    assert [near.answer.id for near in by_room(rows)] == order
