"""How many more would decide: enough is enough, and it is said for which side."""

import math
from types import SimpleNamespace

import pytest

from gates.bounds import interval_of
from gates.criterion import Measured
from gates.more import ASTRIDE, HARDLY, INSIDE, astride, enough, no_decision, times_as_many


@pytest.mark.parametrize("trials", [20, 60, 223])
@pytest.mark.parametrize("share", [0.0, 0.1, 0.3, 0.43])
@pytest.mark.parametrize("beyond", [0.3, 0.6, 0.9])
def test_so_many_of_the_same_share_bring_the_end_to_the_limit(trials, share, beyond):
    """An exact bound of a share, which is what gates judge; counts are rounded, as there."""
    ends = interval_of(share, trials, confidence=0.95, favourable=False)
    limit = share + beyond * (ends[1] - share)
    times = times_as_many(share, ends, limit)
    assert times == pytest.approx(1.0 / beyond**2)
    more = math.ceil(times * trials)
    upper = interval_of(share, more, confidence=0.95, favourable=False)[1]
    assert upper <= limit + 1.0 / more, "a count is rounded up by less than one"
    if share > 0.0:  # nothing at all shrinks faster, and so many are more than are needed
        fewer = math.floor(0.5 * more)
        assert interval_of(share, fewer, confidence=0.95, favourable=False)[1] > limit


def test_the_end_that_faces_the_limit_is_the_one_that_must_move():
    assert times_as_many(0.4, (0.1, 0.6), 0.5) == pytest.approx(4.0)
    assert times_as_many(0.4, (0.1, 0.6), 0.3) == pytest.approx(9.0)
    assert times_as_many(0.5, (0.1, 0.6), 0.5) == math.inf
    assert times_as_many(0.4, (0.39, 0.41), 0.5) == 1.0


@pytest.mark.parametrize(
    ("point", "limit", "comparison", "said"),
    [
        (0.4305, 0.5, "<=", "about 1.3 times as many (223 episodes now) show that it holds"),
        (0.4305, 0.4, "<=", "about 6.1 times as many (223 episodes now) show that it is broken"),
        (0.4305, 0.4, ">=", "about 6.1 times as many (223 episodes now) show that it holds"),
        (0.4305, 0.5, ">=", "about 1.3 times as many (223 episodes now) show that it is broken"),
    ],
)
def test_it_is_said_what_more_of_the_same_would_show(point, limit, comparison, said):
    text = enough(point, (0.355647, 0.507708), limit, comparison, counted="223 episodes")
    assert text == f"{said}, if they say the same" and ";" not in text


def test_what_lies_on_the_limit_is_not_promised_to_decide():
    near = "so near that 10 times as many (9 starts now) may not decide"
    assert enough(0.5, (0.4, 0.6), 0.5, "<=", counted="9 starts") == near
    assert enough(0.5, (0.4, 0.6), 0.531, "<=", counted="9 starts") == near
    assert enough(0.5, (0.4, 0.6), 0.532, "<=", counted="9 starts").startswith("about 9.8 times")


@pytest.mark.parametrize(
    "measured",
    [
        Measured(0.6, (0.4, 0.6), counted="9 starts"),
        Measured(0.6, None, counted="9 starts", point=0.5),
        Measured(0.6, (0.4, 0.6), counted="9 starts", point=math.nan),
        Measured(0.6, (-math.inf, 0.6), counted="9 starts", point=0.5),
    ],
)
def test_without_what_was_seen_and_both_ends_no_number_is_made_up(measured):
    assert astride(measured, 0.55, "<=") == ASTRIDE and ASTRIDE.startswith(INSIDE)


def test_an_end_on_the_limit_itself_asks_for_a_few_more():
    said = enough(0.2, (0.1, 0.3), 0.1, "<=", counted="9 starts")
    assert said.startswith("about 1.1 times as many (9 starts now) show that it is broken")


@pytest.mark.parametrize(
    ("caveats", "of_use"),
    [
        ([f"{INSIDE}: {HARDLY} (30 now) may not decide"], False),
        ([f"{INSIDE}: {HARDLY} (30 now) may not decide", "not measured: no rows"], True),
        ([f"{INSIDE}: about 2 times as many (30 now) show that it holds"], True),
        ([], True),
    ],
)
def test_nobody_is_sent_to_complete_what_hardly_decides(caveats, of_use):
    held = SimpleNamespace(verdict="PASS", caveat=HARDLY)
    broken = SimpleNamespace(verdict="FAIL", caveat=HARDLY)
    open_ = [SimpleNamespace(verdict="INCONCLUSIVE", caveat=caveat) for caveat in caveats]
    said = no_decision([held, broken, *open_])
    assert said.startswith("No decision: ") and ("complete the evidence" in said) == of_use
