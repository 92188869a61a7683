"""The front of the sweep, and the rule that names a setting: golden by hand, and properties."""

import math
from dataclasses import replace

import evidence
import numpy as np
import pytest
from editing import cells

from gates.evidence import Evidence, MissingEvidenceError
from gates.pages.page import gate_page
from gates.proof import judge
from gates.reproducibility.front import (
    SWEEP,
    Setting,
    advice,
    choice,
    deadline_of,
    efficient,
    settings_of,
)
from gates.reproducibility.latency_budget import LATENCY, budget_of
from genpolicy.evidence.rows.reproducibility import LatencyRow

CONFIDENCE = 0.95
COVERAGE = "reload/coverage.parquet"


def setting(name, p50_s, coverage, *, error=0.1, jerk=1000.0, answer_s=None, lower=None):
    return Setting(
        name=name, sha256=name, nfe=1, tolerance=None, p50_s=p50_s,
        answer_s=p50_s + 0.05 if answer_s is None else answer_s, coverage=coverage,
        coverage_lower=coverage - 0.1 if lower is None else lower, chunk_error=error,
        jerk_p95_m_s3=jerk,
    )  # fmt: skip


FOUR = [
    setting("two", 0.002, 0.60, error=0.2),
    setting("four", 0.004, 0.86),
    setting("eight", 0.008, 0.95),
    setting("many", 0.200, 0.99),
]


def test_the_cheapest_within_the_interval_of_the_best_that_keeps_the_deadline():
    """By hand: `many` answers too late; `eight` is best, from 0.85 on; `four` is not below."""
    found = choice(FOUR, deadline_s=0.15)
    assert [s.name for s in (found.deploy, found.best, found.cheaper)] == ["four", "eight", "two"]
    deploy, loses = advice(found, deadline_s=0.15)
    assert deploy == (
        "four: the cheapest whose answer keeps 150 ms and whose coverage, 86 %, is not below "
        "85 %, where the interval of the best begins (eight, 95 %)."
    )
    assert loses == "two saves 2 ms; coverage -26 points, chunk error +100 %, jerk +0 %."


def test_a_setting_that_diverges_is_never_advised_and_never_on_the_front():
    """It is the cheapest, and nothing is known of its error."""
    lost = replace(setting("one", 0.001, 0.99, error=math.nan, jerk=math.nan), nonfinite=2)
    settings = [lost, *FOUR]
    assert efficient(settings) == [False, *efficient(FOUR)] and any(efficient(FOUR))
    assert FOUR[0].dominates(lost) and not lost.dominates(FOUR[0])
    assert choice(settings, deadline_s=0.15) == choice(FOUR, deadline_s=0.15)
    assert choice([lost], deadline_s=0.15).deploy is None


def test_a_cheaper_setting_that_misses_the_deadline_is_said_to():
    """A median of 2 ms and answers of 300: once said to save a millisecond and to be better."""
    cheap = setting("cheap", 0.002, 0.99, answer_s=0.300)
    kept = setting("kept", 0.003, 0.90, answer_s=0.060)
    found = choice([cheap, kept], deadline_s=0.15)
    assert (found.deploy.name, found.cheaper.name) == ("kept", "cheap")
    assert advice(found, deadline_s=0.15)[1] == (
        "cheap saves 1 ms and misses the deadline: its answer takes 300 ms; coverage +9 points, "
        "chunk error +0 %, jerk +0 %."
    )
    in_time = advice(choice(FOUR, deadline_s=0.15), deadline_s=0.15)[1]
    assert "misses" not in in_time


def test_settings_of_one_sampler_and_as_many_steps_have_names_of_their_own(repo):
    """As `ddim` with other noise, or without a bound: wrong before, one name for all of them."""
    told = {"flow2": "eta 1", "flow4": "clip none"}

    def alike(frame):
        frame = frame.assign(settings=frame["sampler_sha256"].map(told).fillna(""))
        frame["tolerance"] = frame["tolerance"].astype(float)
        frame.loc[frame["sampler_sha256"] == "flow8", "tolerance"] = 0.01
        return frame.assign(sampler="ddim", steps=16)

    evidence.edit_table(repo, COVERAGE, alike)
    found = settings_of(Evidence(repo), "flow", confidence=CONFIDENCE)
    assert [one.name for one in found] == [
        "ddim, 16 steps, eta 1", "ddim, 16 steps, clip none", "ddim, 16 steps, tolerance 0.01",
        "ddim, 16 steps",
    ]  # fmt: skip
    evidence.edit_table(repo, COVERAGE, lambda f: alike(f).assign(settings="", tolerance=None))
    unsaid = settings_of(Evidence(repo), "flow", confidence=CONFIDENCE)
    assert len({one.name for one in unsaid}) == len(unsaid), (
        "by their hash where nothing else tells"
    )


def test_a_setting_that_was_always_given_up_is_a_row_without_an_answer(repo):
    """It has no times, which of one that answered is missing evidence."""

    def capped(frame):
        own = frame["sampler_sha256"] == "flow4"
        frame.loc[own, ["nonfinite", "given_up"]] = 30
        frame.loc[own, ["chunk_error", "jerk_p95_m_s3"]] = math.nan
        return frame

    evidence.edit_table(repo, COVERAGE, capped)
    name = SWEEP.removeprefix("artifacts/")
    evidence.edit_table(repo, name, lambda f: f[f["sampler_sha256"] != "flow4"])
    found = settings_of(Evidence(repo), "flow", confidence=CONFIDENCE)
    assert [one.name for one in found][-1] == "euler, 4 steps" and len(found) == 4
    assert (found[-1].given_up, found[-1].answer_s) == (30, math.inf)
    assert not efficient(found)[-1]
    chosen = choice(found, deadline_s=1.0)
    assert found[-1] not in (chosen.deploy, chosen.best, chosen.cheaper)
    report = judge(repo, "B")
    page = gate_page(repo, report)
    assert "no: 30 chunks were given up at its cap" in page and "no answer" in page


def test_the_deadline_decides_what_is_asked():
    assert choice(FOUR, deadline_s=0.3).best.name == "many"
    only = choice(FOUR, deadline_s=0.0525)
    assert only.deploy.name == only.best.name == "two" and only.cheaper is None
    assert advice(only, deadline_s=0.0525)[1] == "There is no cheaper one in the sweep."
    none = choice(FOUR, deadline_s=0.01)
    assert none.deploy is None and advice(none, deadline_s=0.01)[0].startswith("None: no answer")
    unknown = [replace(FOUR[0], answer_s=float("nan"))]
    assert choice(unknown, deadline_s=0.15).deploy is None, "a time that is no number keeps nothing"


def test_a_setting_is_off_the_front_only_where_another_is_as_good_in_everything():
    dear = setting("dear", 0.009, 0.95)
    assert efficient([*FOUR, dear]) == [True, True, True, True, False]
    assert efficient([*FOUR, replace(dear, jerk_p95_m_s3=999.0)]) == [True] * 5
    assert efficient([FOUR[0], FOUR[0]]) == [True, True], "equal ones do not beat each other"


def test_whoever_is_off_the_front_is_beaten_by_one_that_is_on_it():
    rng = np.random.default_rng(0)
    drawn = [
        setting(f"s{n}", *rng.integers(1, 4, 2) / 10, error=rng.integers(1, 4) / 10, jerk=1.0)
        for n in range(30)
    ]
    on = efficient(drawn)
    assert 0 < sum(on) < 30
    front = [one for one, kept in zip(drawn, on, strict=True) if kept]
    for one, kept in zip(drawn, on, strict=True):
        assert kept != any(other.dominates(one) for other in front)


def test_the_answer_holds_every_term_that_the_sweep_did_not_time(repo):
    held = Evidence(repo)
    found = settings_of(held, "flow", confidence=CONFIDENCE)
    assert [(s.name, s.nfe) for s in found] == [
        (f"euler, {nfe} steps", nfe) for nfe in (2, 4, 8, 16)
    ]
    budget = budget_of(held.of(LATENCY, LatencyRow, "flow"), "warm", confidence=CONFIDENCE)
    others = [t for t in budget.terms if t not in ("preprocess", "encode", "sample", "select")]
    assert len(others) == 7
    rest_s = sum(budget.terms[name].p95[0] for name in others)
    assert found[0].answer_s == pytest.approx(2.04e-3 + rest_s)
    assert found[0].p50_s == pytest.approx(2.02e-3)
    assert deadline_of(held, "flow") > 0


def test_a_setting_without_times_is_not_known(repo):
    name = SWEEP.removeprefix("artifacts/")
    evidence.edit_table(repo, name, lambda f: f[f["sampler_sha256"] != "flow4"])
    with pytest.raises(MissingEvidenceError, match="no times of flow, euler, 4 steps"):
        settings_of(Evidence(repo), "flow", confidence=CONFIDENCE)
    settings_of(Evidence(repo), "diffusion", confidence=CONFIDENCE)


def test_slower_times_move_the_choice(repo):
    """The rule reads the evidence: all but the cheapest made too slow."""
    evidence.edit_table(
        repo, SWEEP.removeprefix("artifacts/"),
        lambda f: f.assign(seconds=f["seconds"] + 9.0 * (f["sampler_sha256"] != "flow2")),
    )  # fmt: skip
    found = settings_of(Evidence(repo), "flow", confidence=CONFIDENCE)
    assert choice(found, deadline_s=1.0).best.name == "euler, 2 steps"
    evidence.edit_table(repo, COVERAGE, cells("modes_covered_share", 0.5))
    with pytest.raises(MissingEvidenceError, match="euler, 2 steps below the lower end"):
        settings_of(Evidence(repo), "flow", confidence=CONFIDENCE)


def test_a_setting_that_covers_nothing_has_its_lower_end_there(repo):
    """The exact lower end of no mode covered is 0 itself: it is known, and nobody would take it."""
    none = {"modes_covered_share": 0.0, "coverage_lower": 0.0}
    evidence.edit_table(repo, COVERAGE, lambda f: f.assign(**none))
    found = settings_of(Evidence(repo), "flow", confidence=CONFIDENCE)
    assert {(one.coverage, one.coverage_lower) for one in found} == {(0.0, 0.0)}


@pytest.mark.parametrize("column", ["chunk_error", "jerk_p95_m_s3", "modes_covered_share"])
def test_what_is_no_number_beats_nobody_and_is_not_undominated(ladder, column):
    """Nothing is smaller than a NaN, so that it would stand on the front for ever."""
    evidence.edit_table(ladder, COVERAGE, cells(column, math.nan))
    with pytest.raises(MissingEvidenceError):
        settings_of(Evidence(ladder), "flow", confidence=CONFIDENCE)


def test_a_setting_in_no_time_was_not_timed(ladder):
    evidence.edit_table(ladder, SWEEP.removeprefix("artifacts/"), cells("seconds", 0.0))
    with pytest.raises(MissingEvidenceError, match="in no time"):
        settings_of(Evidence(ladder), "flow", confidence=CONFIDENCE)
