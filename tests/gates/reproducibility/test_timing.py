"""Latency: two runs are held against each other, and every term is known."""

import evidence
import pytest
from asked import asked, found_in
from editing import cells

from gates.proof import judge
from gates.reproducibility.timing import MEASURED_HERE, TERMS, latency_terms_missing

LATENCY = "latency/latency.parquet"


@pytest.mark.parametrize(("run", "seconds"), [(1, 0.004), (2, 0.004)])
def test_the_slower_of_two_runs_is_held_against_the_faster_whichever_it_is(ladder, run, seconds):
    """Of what was measured warm: cold calls and declared terms are no part of the question."""

    def change(frame):
        warm = (frame["source"] == "measured") & (frame["temperature"] == "warm")
        frame.loc[warm, "seconds"] = 0.001
        frame.loc[warm & (frame["run"] == run), "seconds"] = seconds
        frame.loc[~warm & (frame["run"] == 3 - run), "seconds"] = 9.0
        return frame

    evidence.edit_table(ladder, LATENCY, change)
    for found in found_in(judge(ladder, "B"), "latency_median_ratio"):
        assert found.measured == pytest.approx(4.0)
        assert found.caveat.endswith("at 4") and found.verdict == "FAIL"


def test_a_run_that_took_no_time_was_not_measured(ladder):
    evidence.edit_table(ladder, LATENCY, cells("seconds", 0.0))
    found = found_in(judge(ladder, "B"), "latency_median_ratio")[0]
    assert found.measured is None and "took no time" in found.caveat


@pytest.mark.parametrize("term", TERMS)
def test_a_term_that_is_not_known_is_missing_and_never_zero(ladder, term):
    assert asked(ladder, latency_terms_missing, "flow", gate="B").value == 0
    evidence.edit_table(
        ladder, LATENCY, cells("seconds", None, where=lambda f: f["component"] == term)
    )
    found = asked(ladder, latency_terms_missing, "flow", gate="B")
    assert found.value == 1 and found.caveat == f"missing: {term}"


def test_a_term_that_is_measured_here_may_not_be_declared(ladder):
    evidence.edit_table(ladder, LATENCY, cells("source", "declared"))
    found = asked(ladder, latency_terms_missing, "flow", gate="B")
    assert found.caveat == f"missing: {', '.join(MEASURED_HERE)}"


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
    found = found_in(judge(ladder, "B"), "latency_median_ratio")[0]
    assert found.measured is None and "two runs of every measured component" in found.caveat
