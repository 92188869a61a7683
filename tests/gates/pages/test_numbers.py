"""Numbers as people read them, and what was held against a limit."""

import re

import pytest
from test_verdicts import criterion

from gates.pages.numbers import at_its_end, beyond, judged_at, limit_said, recounted
from gates.readable import between, found_text, human, rests_on
from gates.report import Recount


def of(**changes):
    return criterion("PASS").model_copy(update=changes)


@pytest.mark.parametrize(
    ("name", "limit", "value", "text"),
    [
        ("clock_residual_s", 0.01, 0.000892, "0.892 ms"),
        ("latency_p95_s", 0.4, 1.25, "1.25 s"),
        ("projection_p95_m", 0.02, 0.0094, "9.4 mm"),
        ("force_peak_p95_n", 80, 73.94, "73.9 N"),
        ("told_share", 0.4, 0.1575, "15.8 %"),
        ("warm_latency_ratio_upper", 1.5, 1.26, "×1.26"),
        ("latent_dependence_p", 0.05, 0.034, "0.034"),
        ("stub_stale", 0, 0.0, "0"),
        ("promotion_e_value", 60, 61.234, "61.2 to 1"),
        ("promotion_e_value", 20, 6843315.4, "6,840,000 to 1"),
        ("strata_effect", 0.3, 0.11536, "11.5 %"),
        ("told_share", 0.4, None, "not measured"),
        ("held_out_situations", 100, 13345.0, "13,345"),
        ("boundary_jerk_p95_m_s3", 3250, 2031.7, "2,030 m/s³"),
        ("latency_p95_s", 0.4, 1e9, "1e+09 s"),
        ("latency_p95_s", 0.4, 0.9997, "1,000 ms"),
        ("lag_spread_rows", 3, 1.0, "1 action step"),
        ("lag_spread_rows", 3, 2.0, "2 action steps"),
        ("told_share", 0.5, 0.500123, "50.01 %"),
        ("told_share", 0.5, 0.500000001, "50.0000001 %"),
        ("told_share", 0.5, 0.5, "50 %"),
        ("latency_p95_s", 0.4, 0.39996, "399.96 ms"),
        ("boundary_jerk_p95_m_s3", 3250, 3250.5, "3,250.5 m/s³"),
        ("promotion_e_value", 60, 59.99, "59.99 to 1"),
        ("admissible_share", 0.9975, 0.9975, "99.75 %"),
        ("promotion_e_value", 100 / 3, 100 / 3, "33.3 to 1"),
        ("told_share", 1e9, 0.70804, "70.8 %"),
        ("told_share", 1e9, 1e9, "100,000,000,000 %"),
        ("mode_success_lower", -1e9, -1e9, "-100,000,000,000 %"),
        ("mode_success_lower", -1e9, 0.7, "70 %"),
        ("parameter_budget_deviation", 1.5, 1.2, "120 %"),
    ],
)
def test_numbers_stand_in_the_unit_of_a_person(name, limit, value, text):
    assert human(of(id=name, threshold=limit), value) == text


@pytest.mark.parametrize(("comparison", "measured", "where", "said"), [
    ("<=", 0.3, "the worse end", "at most 30 %"), ("<=", 0.1, "the better end", "at least 10 %"),
    (">=", 0.1, "the worse end", "at least 10 %"), (">=", 0.3, "the better end", "at most 30 %"),
    (">=", 0.2, "a point of its interval", "20 %"),
])  # fmt: skip
def test_which_end_was_judged_is_said_as_it_was(comparison, measured, where, said):
    """The worst of some conditions may be judged at the end that speaks for it."""
    found = of(id="told_share", threshold=0.5, comparison=comparison, measured=measured,
               interval=(0.1, 0.3))  # fmt: skip
    assert (judged_at(found), at_its_end(found)) == (where, said)


def test_without_an_interval_a_point_is_judged_and_without_a_number_nothing():
    assert judged_at(of(measured=0.2)) == "a point" and judged_at(of(measured=None)) == ""
    assert at_its_end(of(id="a_share", threshold=1.0, measured=0.2)) == "20 %"
    assert at_its_end(of(measured=None, interval=(0.0, 1.0))) == "not measured"


PLAIN = re.compile(
    r"latent_dependence_p|.*(situations|keys|items|weights|mismatches|checks|defects|missing|starts"
    r"|invalid|stale|violations|miscounted|undetected|answers|accounted|matched|isolated|mismatch"
    r"|error|complete|within_limits|conformance|accepted|passed|valid|independent|expired|signed"
    r"|difference)"
)
"""Counts, questions with yes or no, a probability, and differences of normalized actions."""


def test_each_number_that_is_no_count_says_what_it_is(judged):
    """A share without a percent sign reads like a number of something."""
    for gate in "ABCDE":
        for c in judged(gate).criteria:
            said = human(c, c.threshold)
            if not re.search(r" (%|m?s|mm|m|N|m/s³|action steps?|to 1)$|^×", said):
                assert PLAIN.fullmatch(c.id), (c.id, said)


@pytest.mark.parametrize(("name", "comparison", "measured", "limit", "interval", "said"), [
    ("told_share", "<=", 0.508, 0.5, None, "over by 0.8 points"),
    ("some_lower", ">=", 0.508, 0.6, None, "short by 9.2 points"),
    ("clock_residual_s", "<=", 0.013, 0.01, None, "over by 3 ms"),
    ("warm_latency_ratio_upper", "<=", 1.75, 1.5, None, "over by 0.25"),
    ("stub_stale", "<=", 3.0, 0.0, None, "over by 3"),
    ("promotion_e_value", ">=", 1.6, 20.0, None, "short by a factor of 12.5"),
    ("told_share", "<=", 0.508, 0.5, (0.356, 0.508), "the limit lies inside 35.6 to 50.8 %"),
    ("latency_p95_s", "<=", 1.2, 1.0, (0.9, 1.2), "the limit lies inside 900 ms to 1.2 s"),
])  # fmt: skip
def test_what_does_not_hold_says_how_far_from_its_limit(
    name, comparison, measured, limit, interval, said
):
    verdict = "INCONCLUSIVE" if interval else "FAIL"
    found = of(id=name, comparison=comparison, measured=measured, threshold=limit,
               interval=interval, verdict=verdict)  # fmt: skip
    assert beyond(found) == said
    assert not beyond(found.model_copy(update={"verdict": "PASS"}))
    assert not beyond(found.model_copy(update={"measured": None}))
    assert between(found.model_copy(update={"interval": None})) == ""


@pytest.mark.parametrize(
    ("verdict", "interval", "counted", "said"),
    [
        ("INCONCLUSIVE", (0.418, 0.554), "280 episodes", "41.8 to 55.4 % (280 episodes)"),
        ("INCONCLUSIVE", None, "0 of 1080 episodes", "55.4 % (none of 1,080 episodes)"),
        ("FAIL", (0.518, 0.554), "280 episodes", "55.4 % (280 episodes)"),
        ("FAIL", None, "", "55.4 %"),
        ("FAIL", None, "all 1200 actions", "55.4 % (over all 1,200 actions)"),
    ],
)
def test_what_is_not_decided_is_said_by_its_interval_and_of_how_many(
    verdict, interval, counted, said
):
    """Its worse end alone looks like a limit that is broken."""
    answer = of(
        id="x_share", comparison="<=", threshold=0.5, measured=0.554, verdict=verdict,
        interval=interval, counted=counted,
    )  # fmt: skip
    assert found_text(answer) == said


def test_a_limit_is_said_in_the_unit_of_its_number():
    assert limit_said(of(id="clock_residual_s", threshold=0.01)) == "≤ 10 ms"
    assert limit_said(of(id="told_share", threshold=0.4, comparison=">=")) == "≥ 40 %"
    assert limit_said(of(threshold=None)) == "no limit"


@pytest.mark.parametrize(("counted", "said"), [
    ("0 of 1080 arrivals", "none of 1,080 arrivals"), ("24 of 25 episodes", "24 of 25 episodes"),
    ("10 of 1080 arrivals", "10 of 1,080 arrivals"), ("3 and 3 processes", "3 and 3 processes"),
    ("", ""),
])  # fmt: skip
def test_what_a_number_rests_on(counted, said):
    assert rests_on(counted) == said


def recount(**changes):
    said = {"table": "t", "method": "m", "where": ("a = 1", "b = x"), "columns": ("a", "b"),
            "of": "", "whole": 1234.0, "hits": (), "summed": (), "part": None}  # fmt: skip
    return Recount(**{**said, **changes})


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({}, "a = 1 and b = x: 1,234 rows"),
        ({"where": (), "whole": 1.0}, "all rows: 1 row"),
        ({"hits": ("c = true", "d >= 2"), "part": 0.0},
         "a = 1 and b = x: 1,234 rows, of them c = true and d >= 2 in 0"),
        ({"of": "ticks", "summed": ("held",), "part": 12.0},
         "a = 1 and b = x: ticks adds up to 1,234, held adds up to 12"),
        ({"of": "ticks", "summed": ("held", "late"), "part": 12.0},
         "a = 1 and b = x: ticks adds up to 1,234, held and late add up to 12"),
        ({"of": "ticks"}, "a = 1 and b = x: ticks adds up to 1,234"),
        ({"hits": ("c = " + " or ".join("abcdefgh"),), "part": 3.0},
         "a = 1 and b = x: 1,234 rows, of them c = a or 7 others that criteria.csv lists in 3"),
    ],
)  # fmt: skip
def test_a_number_says_how_it_is_counted_again(changes, said):
    assert recounted(recount(**changes)) == said
