"""Latency: two measurements and a model are held against processes, and every term is known."""

import evidence
import numpy as np
import pytest
from asked import asked, found_in
from editing import cells

from gates.evidence import MissingEvidenceError
from gates.proof import judge
from gates.reproducibility import timing
from gates.reproducibility.latency_budget import MEASURED_HERE, TERMS
from gates.reproducibility.timing import (
    DECLARED,
    latency_model_ratio_upper,
    latency_terms_missing,
)

LATENCY = "latency/latency.parquet"
MODEL = "latency/model.parquet"

UNKNOWN = {"measured_running_s": np.nan, "drawn_running_s": np.nan}
RATIOS = {"warm": "warm_latency_ratio_upper", "cold": "cold_latency_ratio_upper"}


@pytest.fixture(autouse=True)
def _believed(monkeypatch):
    """The ratio is asked here; that a model is that of its times, in `test_held`."""
    monkeypatch.setattr(timing, "require_as_timed", lambda *_, **__: None)


@pytest.mark.parametrize("temperature", RATIOS)
@pytest.mark.parametrize("run", [1, 2])
def test_the_slower_measurement_is_held_against_the_faster_whichever_it_is(
    ladder, temperature, run
):
    """Of one temperature: the other one and declared terms are no part of the question."""

    def change(frame):
        own = (frame["source"] == "measured") & (frame["temperature"] == temperature)
        frame.loc[own, "seconds"] = 0.001
        frame.loc[own & (frame["run"] == run), "seconds"] = 0.004
        frame.loc[~own & (frame["run"] == 3 - run), "seconds"] = 9.0
        return frame

    evidence.edit_table(ladder, LATENCY, change)
    for found in found_in(judge(ladder, "B"), RATIOS[temperature]):
        assert found.measured == pytest.approx(4.0)
        assert "×4" in found.caveat and found.verdict == "FAIL"


def test_cold_is_the_first_call_of_a_process_and_no_later_one(ladder):
    """Only that one pays for what a process does once: imports, caches, kernels."""

    def change(frame, repeats):
        frame.loc[:, "seconds"] = 0.001
        own = (frame["temperature"] == "cold") & (frame["run"] == 2)
        frame.loc[own & frame["repeat"].isin(repeats), "seconds"] = 0.01
        return frame

    for repeats, expected in (([0], 10.0), ([1, 2, 3, 4, 5, 6, 7], 1.0)):
        evidence.edit_table(ladder, LATENCY, lambda f, r=repeats: change(f, r))
        for found in found_in(judge(ladder, "B"), RATIOS["cold"]):
            assert found.measured == pytest.approx(expected)
        for found in found_in(judge(ladder, "B"), RATIOS["warm"]):
            assert found.measured == pytest.approx(1.0)


@pytest.mark.parametrize("temperature", RATIOS)
def test_processes_that_scatter_show_nothing_though_their_means_agree(ladder, temperature):
    """The unit is the process: many invocations of three processes are three."""

    def scattered(frame):
        factor = np.choose(frame["process"] - 1, [0.5, 1.0, 2.0])
        return frame.assign(seconds=0.001 * factor)

    evidence.edit_table(ladder, LATENCY, scattered)
    for found in found_in(judge(ladder, "B"), RATIOS[temperature]):
        assert found.verdict == "INCONCLUSIVE" and found.measured > 2.0
        assert found.interval == (1.0, found.measured)
        assert "pass in four of five if processes differ by" in found.caveat


@pytest.mark.parametrize(
    ("keep", "why"),
    [(lambda f: f["run"] == 1, "in process 1 of run 2"),
     (lambda f: (f["run"] == 1) | (f["process"] == 1), "in process 2 of run 2"),
     (lambda f: f["process"] == 1, "in process 2 of run 1"),
     (lambda f: (f["process"] > 1) | (f["repeat"] < 4), "in process 1 of run 1; planned are 8")],
)  # fmt: skip
def test_too_few_processes_are_no_answer(ladder, keep, why):
    declared = "declared"
    evidence.edit_table(
        ladder, LATENCY, lambda f: f[keep(f) | (f["source"] == declared)].reset_index(drop=True)
    )
    for name in RATIOS.values():
        found = found_in(judge(ladder, "B"), name)[0]
        assert found.measured is None and why in found.caveat


def test_a_run_that_took_no_time_was_not_measured(ladder):
    evidence.edit_table(ladder, LATENCY, cells("seconds", 0.0))
    for name in RATIOS.values():
        found = found_in(judge(ladder, "B"), name)[0]
        assert found.measured is None and "took no time" in found.caveat


def _as_drawn(rows, factor):
    """All processes as drawn, but those of some rows so many times as long."""

    def change(frame):
        measured = frame["drawn_s"] * np.where(rows(frame), factor, 1.0)
        return frame.assign(measured_s=measured, **UNKNOWN)

    return change


def test_a_model_that_draws_too_short_is_seen_and_one_that_draws_too_long_is_not_held_against_it(
    ladder,
):
    def ratio(factor):
        change = _as_drawn(lambda f: f["method"] == "flow", factor)
        evidence.edit_table(ladder, MODEL, change)
        return asked(ladder, latency_model_ratio_upper, "flow", gate="B")

    assert ratio(1.3).value == pytest.approx(1.3) and ratio(1.3).caveat.startswith("flow: ")
    # Then the baselines are what is left to ask, and they are as they were drawn.
    assert ratio(0.5).value == pytest.approx(1.0)


@pytest.mark.parametrize("name", evidence.BASELINES)
def test_a_baseline_that_is_drawn_too_long_is_seen_and_one_that_is_drawn_too_short_is_not(
    ladder, name
):
    """It would miss deadlines that it keeps, and a candidate would win by that."""

    def ratio(factor):
        change = _as_drawn(lambda f: f["method"] == name, factor)
        evidence.edit_table(ladder, MODEL, change)
        return asked(ladder, latency_model_ratio_upper, "flow", gate="B")

    assert ratio(0.5).value == pytest.approx(2.0)
    assert (
        ratio(0.5).caveat.startswith(f"{name}: ") and "drawn over measured ×2;" in ratio(0.5).caveat
    )
    assert ratio(2.0).value == pytest.approx(1.0)


@pytest.mark.parametrize("name", evidence.BASELINES)
def test_a_baseline_without_a_model_leaves_no_verdict(ladder, name):
    evidence.edit_table(ladder, MODEL, lambda f: f[f["method"] != name])
    for found in found_in(judge(ladder, "B"), "latency_model_ratio_upper"):
        assert found.measured is None and name in found.caveat


def test_processes_that_scatter_leave_the_model_unproven(ladder):
    def scattered(frame):
        return frame.assign(
            measured_s=frame["drawn_s"] * np.choose(frame["process"] - 1, [0.5, 1.0, 2.0]),
            **UNKNOWN,
        )

    evidence.edit_table(ladder, MODEL, scattered)
    for found in found_in(judge(ladder, "B"), "latency_model_ratio_upper"):
        assert found.verdict == "INCONCLUSIVE" and found.interval[0] < 1.0 < found.interval[1]


@pytest.mark.parametrize(
    ("change", "why"),
    [(lambda f: f[f["run"] == 1], "several processes of both runs"),
     (lambda f: f[f["level"] == 0.5], "several processes of both runs"),
     (lambda f: f[f["process"] < 4 - f["run"]], "several processes of both runs"),
     (cells("drawn_s", 0.0), "no time")],
)  # fmt: skip
def test_a_model_that_was_not_tried_is_no_answer(ladder, change, why):
    evidence.edit_table(ladder, MODEL, change)
    found = found_in(judge(ladder, "B"), "latency_model_ratio_upper")[0]
    assert found.measured is None and why in found.caveat


@pytest.mark.parametrize("term", TERMS)
def test_a_term_that_is_not_known_is_missing_and_never_zero(ladder, term):
    assert asked(ladder, latency_terms_missing, "flow", gate="B").value == 0
    evidence.edit_table(
        ladder, LATENCY, cells("seconds", None, where=lambda f: f["component"] == term)
    )
    found = asked(ladder, latency_terms_missing, "flow", gate="B")
    assert found.value == 1 and found.caveat.startswith(f"missing: {term}; ")


@pytest.mark.parametrize("seconds", [-0.001, np.nan, np.inf])
def test_a_term_of_which_one_draw_is_no_duration_was_not_declared(ladder, seconds):
    def one(frame):
        return (frame["component"] == "queue") & (frame["repeat"] == 3)

    evidence.edit_table(ladder, LATENCY, cells("seconds", seconds, where=one))
    found = asked(ladder, latency_terms_missing, "flow", gate="B")
    assert found.value == 1 and found.caveat.startswith("missing: queue; ")
    evidence.edit_table(ladder, LATENCY, cells("seconds", 0.0, where=one))
    assert asked(ladder, latency_terms_missing, "flow", gate="B").value == 0


@pytest.mark.parametrize(("owner", "repeats"), [(" ", 8), ("safety", 4)])
def test_one_owner_answers_for_a_term(ladder, owner, repeats):
    """Nobody does, or two of whom each thinks that it is the other."""

    def some(frame):
        return (frame["component"] == "encode") & (frame["repeat"] < repeats)

    evidence.edit_table(ladder, LATENCY, cells("owner", owner, where=some))
    found = asked(ladder, latency_terms_missing, "flow", gate="B")
    assert found.value == 1 and found.caveat.endswith("; not one owner answers for: encode")


@pytest.mark.parametrize(
    ("column", "value"), [("component", "unwrap"), ("temperature", "hot"), ("source", "guessed")]
)
def test_times_that_no_sum_would_hold_are_no_evidence(ladder, column, value):
    """A twelfth term would be neither in an invocation nor in the sum of the terms."""

    def further(frame):
        own = frame[frame["component"] == "sample"]
        return evidence.pd.concat([frame, own.assign(**{column: value, "seconds": 5.0})])

    evidence.edit_table(ladder, LATENCY, further)
    report = judge(ladder, "B")
    for name in ("latency_terms_missing", *RATIOS.values()):
        found = found_in(report, name)[0]
        assert found.measured is None and repr(value) in found.caveat


def test_cold_and_warm_do_not_stand_for_each_other(ladder):
    """A process has few cold invocations, and warm ones in plenty."""

    def swapped(frame):
        few = frame[(frame["temperature"] == "warm") | (frame["repeat"] < 2)]
        return few.assign(temperature=few["temperature"].map({"cold": "warm", "warm": "cold"}))

    evidence.edit_table(ladder, LATENCY, swapped)
    report = judge(ladder, "B")
    for name in RATIOS.values():
        found = found_in(report, name)[0]
        assert found.measured is None
        assert "more cold than warm" in found.caveat or "has 2 warm" in found.caveat


@pytest.mark.parametrize("twice", [False, True])
def test_a_process_that_the_model_was_not_held_against_is_not_left_out(ladder, twice):
    """Four of six would do for an interval; the two that were slowest are not to be dropped."""

    def change(frame):
        kept = frame[frame["process"] < 3]
        return evidence.pd.concat([kept, kept[kept["process"] == 1]]) if twice else kept

    evidence.edit_table(ladder, MODEL, change)
    with pytest.raises(MissingEvidenceError, match="does not hold each timed process once"):
        asked(ladder, latency_model_ratio_upper, "flow", gate="B")


def test_a_term_that_is_measured_here_may_not_be_declared(ladder):
    evidence.edit_table(ladder, LATENCY, cells("source", "declared"))
    found = asked(ladder, latency_terms_missing, "flow", gate="B")
    assert found.caveat.startswith(f"missing: {', '.join(MEASURED_HERE)}; 6 of 11 terms {DECLARED}")


def test_terms_that_are_declared_are_counted_and_named(ladder):
    found = asked(ladder, latency_terms_missing, "flow", gate="B")
    others = ", ".join(term for term in TERMS if term not in MEASURED_HERE)
    assert found.value == 0 and found.caveat == f"6 of 11 terms {DECLARED}: {others}"


@pytest.mark.parametrize(
    "change",
    [
        lambda f: f[(f["component"] != "sample") | (f["run"] == 1)],
        lambda f: f[f["run"] == 1],
        lambda f: f.assign(run=f["run"] + 1),
        lambda f: evidence.pd.concat([f, f[f["run"] == 2].assign(run=3)]),
    ],
    ids=["a component once", "one run", "others", "three"],
)
def test_what_was_not_measured_in_two_runs_is_not_compared(ladder, change):
    evidence.edit_table(ladder, LATENCY, change)
    for name in RATIOS.values():
        found = found_in(judge(ladder, "B"), name)[0]
        assert found.measured is None
        assert any(why in found.caveat for why in ("two runs", "lacks", "of run"))


def test_three_processes_of_each_run_are_planned_and_fewer_do_not_answer(ladder):
    found = [found_in(judge(ladder, "B"), name)[0] for name in RATIOS.values()]
    assert all("over 3 processes each" in one.caveat for one in found)
    two = lambda f: f[(f["process"] < 3) | (f["source"] == "declared")]  # noqa: E731
    evidence.edit_table(ladder, LATENCY, two)
    with pytest.raises(MissingEvidenceError, match="of flow in process 3 of run 1"):
        asked(ladder, latency_model_ratio_upper, "flow", gate="B")
    found = [found_in(judge(ladder, "B"), name)[0] for name in RATIOS.values()]
    assert all("in process 3 of run 1" in one.caveat for one in found)


@pytest.mark.parametrize("column", ["measured_s", "drawn_s"])
def test_a_quantile_of_no_time_on_either_side_is_no_ratio(ladder, column):
    evidence.edit_table(ladder, MODEL, cells(column, 0.0, where=lambda f: f["method"] == "flow"))
    with pytest.raises(MissingEvidenceError, match="flow: a quantile of no time"):
        asked(ladder, latency_model_ratio_upper, "flow", gate="B")


@pytest.mark.parametrize(("limit", "told"), [(1.0, False), (1.0001, True), (2.0, True)])
def test_what_spread_a_limit_allows_is_said_where_it_allows_some(ladder, limit, told):
    """Equal runs differ a little: a limit of 1 allows none, and nothing has to be said of it."""
    change = evidence.set_limit("gate_b", "warm_latency_ratio_upper", limit)
    evidence.write_params(ladder, change)
    found = found_in(judge(ladder, "B"), RATIOS["warm"])[0]
    assert found.measured is not None
    assert ("if processes differ by" in found.caveat) is told


def test_the_least_stable_component_is_named_whichever_run_was_slower(ladder):
    """In run 1 `encode` takes twice as long, in run 2 `sample` half as much again."""

    def change(frame):
        own = frame["source"] == "measured"
        factor = np.where((frame["run"] == 1) & (frame["component"] == "encode"), 2.0, 1.0)
        factor *= np.where((frame["run"] == 2) & (frame["component"] == "sample"), 1.5, 1.0)
        return frame.assign(seconds=frame["seconds"].mask(own, 0.001 * factor))

    evidence.edit_table(ladder, LATENCY, change)
    for name in RATIOS.values():
        assert "least stable component encode, ×2" in found_in(judge(ladder, "B"), name)[0].caveat
