"""Verdicts: monotone, total, and never PASS for what is missing."""

import itertools
import math
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gates.report import Answer, Overridden
from gates.verdicts import (
    SEVERITY,
    best,
    combine,
    counting,
    decided_by,
    decided_text,
    first_unmet,
    judge_criterion,
    rounded,
    worst,
)

NUMBERS = st.floats(allow_nan=False, allow_infinity=False, width=64)
VERDICTS = st.sampled_from(sorted(SEVERITY))


def criterion(verdict: str, candidate: str | None = None, name: str = "x"):
    return Answer(
        id=name,
        question="?",
        owner="model",
        candidate=candidate,
        measured=1.0,
        interval=None,
        threshold=1.0,
        comparison="<=",
        reason="r",
        verdict=verdict,
        evidence=(),
        caveat="",
        counted="",
    )


@given(NUMBERS, NUMBERS, NUMBERS)
def test_worse_never_turns_fail_into_pass(measured, worse, limit):
    low, high = sorted((measured, worse))
    assert not (
        judge_criterion(low, limit, "<=") == "FAIL" and judge_criterion(high, limit, "<=") == "PASS"
    )
    assert not (
        judge_criterion(high, limit, ">=") == "FAIL" and judge_criterion(low, limit, ">=") == "PASS"
    )


@given(NUMBERS, NUMBERS)
def test_rounding_is_monotone(a, b):
    low, high = sorted((a, b))
    assert rounded(low) <= rounded(high)


@pytest.mark.parametrize("comparison", ["<=", ">="])
@pytest.mark.parametrize(
    ("measured", "limit"),
    [(None, 1.0), (1.0, None), (math.nan, 1.0), (1.0, math.nan), (math.inf, 1.0), (-math.inf, 1.0)],
)
def test_missing_or_not_finite_is_inconclusive(measured, limit, comparison):
    assert judge_criterion(measured, limit, comparison) == "INCONCLUSIVE"


def test_the_limit_itself_is_accepted():
    assert judge_criterion(1.0, 1.0, "<=") == judge_criterion(1.0, 1.0, ">=") == "PASS"


@pytest.mark.parametrize(
    ("measured", "limit", "comparison"),
    [(0.9, 0.5, "<="), (0.5 + 1e-9, 0.5, "<="), (-0.9, -1.0, "<="), (0.1, 0.5, ">="),
     (0.5 - 1e-9, 0.5, ">="), (-1.0, -0.9, ">="), (1.0, 0.0, "<="), (0.0, 1.0, ">=")],
)  # fmt: skip
def test_just_beyond_the_limit_fails_and_the_other_side_passes(measured, limit, comparison):
    other: dict = {"<=": ">=", ">=": "<="}
    assert judge_criterion(measured, limit, comparison) == "FAIL"
    assert judge_criterion(measured, limit, other[comparison]) == "PASS"


@pytest.mark.parametrize(
    ("measured", "interval", "comparison", "verdict"),
    [(0.6, (0.4, 0.6), "<=", "INCONCLUSIVE"), (0.6, (0.5, 0.6), "<=", "INCONCLUSIVE"),
     (0.6, (0.5 + 1e-9, 0.6), "<=", "FAIL"), (0.5, (0.4, 0.5), "<=", "PASS"),
     (0.4, (0.4, 0.6), ">=", "INCONCLUSIVE"), (0.4, (0.4, 0.5), ">=", "INCONCLUSIVE"),
     (0.4, (0.4, 0.5 - 1e-9), ">=", "FAIL"), (0.5, (0.5, 0.6), ">=", "PASS"),
     (0.6, (math.nan, math.nan), "<=", "FAIL"), (0.6, (-math.inf, 0.6), "<=", "INCONCLUSIVE")],
)  # fmt: skip
def test_a_limit_inside_the_interval_is_neither_kept_nor_broken(
    measured, interval, comparison, verdict
):
    """By luck nothing passes, and by luck nothing fails."""
    assert judge_criterion(measured, 0.5, comparison, interval) == verdict


@given(NUMBERS, NUMBERS, NUMBERS, st.sampled_from(["<=", ">="]))
def test_an_interval_never_makes_a_pass(one, other, limit, comparison):
    low, high = sorted((one, other))
    worse = high if comparison == "<=" else low
    alone = judge_criterion(worse, limit, comparison)
    found = judge_criterion(worse, limit, comparison, (low, high))
    assert (found == "PASS") is (alone == "PASS")


def test_a_number_is_known_to_twelve_digits():
    assert rounded(0.1 + 0.2) == 0.3 and rounded(1.0000000000004) == 1.0
    assert rounded(1.00000000001) == 1.00000000001  # the twelfth digit still counts
    assert rounded(1.000000000001) == 1.0  # the thirteenth does not


def test_what_fails_is_worse_than_what_is_missing_and_that_than_what_waits():
    order = ["PASS", "PENDING_REVIEW", "INCONCLUSIVE", "FAIL"]
    for better, worse in itertools.combinations(order, 2):
        for pair in ([better, worse], [worse, better]):
            assert (best(pair), worst(pair)) == (better, worse)


def test_nothing_judged_is_inconclusive():
    assert combine([], expects_candidates=False)[0] == "INCONCLUSIVE"
    assert combine([criterion("PASS")], expects_candidates=True)[0] == "INCONCLUSIVE"


@given(st.lists(VERDICTS, min_size=1, max_size=5))
def test_gate_wide_criteria_are_an_intersection(verdicts):
    verdict, _ = combine([criterion(v) for v in verdicts], expects_candidates=False)
    assert (verdict == "PASS") == all(v == "PASS" for v in verdicts)


@given(st.dictionaries(st.sampled_from("abc"), st.lists(VERDICTS, min_size=1), min_size=1))
def test_candidates_are_a_union_of_intersections(cases):
    criteria = [criterion(v, name) for name, found in cases.items() for v in found]
    verdict, candidates = combine(criteria, expects_candidates=True)
    assert (verdict == "PASS") == any(all(v == "PASS" for v in f) for f in cases.values())
    assert {n for n, v in candidates.items() if v == "PASS"} == {
        n for n, found in cases.items() if all(v == "PASS" for v in found)
    }


def test_the_first_unmet_criterion_is_named_required_before_candidates():
    rows = [criterion("FAIL", "m", name="own"), criterion("FAIL", name="common")]
    assert first_unmet(rows, "FAIL").id == "common"
    assert first_unmet(rows, "PASS") is None
    assert first_unmet(rows[:1], "FAIL").id == "own"
    assert first_unmet([criterion("PASS"), *rows], "INCONCLUSIVE") is None


@pytest.mark.parametrize(
    ("gate", "instead", "spared"),
    [("A", "PASS", True), ("A", "FAIL", False), ("A", None, False), ("B", "PASS", False)],
)
def test_what_is_overridden_decides_nothing_if_it_holds_so_and_is_of_this_gate(
    gate, instead, spared
):
    rows = [criterion("FAIL", None, "first"), criterion("FAIL", None, "second")]
    entry = Overridden(
        gate=gate, criterion="first", candidate=None, comparison="<=", threshold=1.0, limit=2.0,
        by="rita", reason="r", expires="2026-12-24", verdict="FAIL", instead=instead,
        without="FAIL",
    )  # fmt: skip
    changes = {"gate": "A", "verdict": "FAIL", "criteria": tuple(rows), "overrides": (entry,)}
    report = SimpleNamespace(**changes)
    assert counting(report) == (rows[1:] if spared else rows)
    assert decided_by(report).id == ("second" if spared else "first")
    assert decided_text(report).startswith("second" if spared else "first")
    report.verdict = "PASS"
    assert decided_by(report) is None


def test_what_its_looser_limit_does_not_decide_decides_as_what_it_is_then():
    """Else nothing has the verdict of the report, and something else is named."""
    rows = (criterion("FAIL", None, "first"), criterion("INCONCLUSIVE", None, "second"))
    entry = Overridden(
        gate="A", criterion="first", candidate=None, comparison="<=", threshold=1.0, limit=2.0,
        by="rita", reason="r", expires="2026-12-24", verdict="FAIL", instead="INCONCLUSIVE",
        without="FAIL",
    )  # fmt: skip
    report = SimpleNamespace(gate="A", verdict="INCONCLUSIVE", criteria=rows, overrides=(entry,))
    assert [c.verdict for c in counting(report)] == ["INCONCLUSIVE"] * 2
    assert decided_by(report).id == "first"
    assert rows[0].verdict == "FAIL", "its own verdict stays"
