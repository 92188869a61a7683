"""Every number with an interval says what it rests on, and the desk shows it."""

import re

import evidence
import pandas as pd
import pytest

from gates.doubts_of_evidence import few_units
from gates.pages.rows import rows_of
from gates.proof import judge
from gates.readable import human
from gates.writing import write_gate, write_index

UNITS = (
    "episodes|situations|processes|observations|candidates|starts|replays|chunks|simulated trials"
)
COUNTED = re.compile(rf"\d+( of \d+| and \d+)? ({UNITS})( of the rarer mode)?")


@pytest.mark.parametrize("gate", "ABCD")
def test_an_interval_says_how_many_independent_units_it_is_of(ladder, gate):
    answers = [c for c in judge(ladder, gate).criteria if c.interval is not None]
    assert answers
    assert [c.id for c in answers if not COUNTED.fullmatch(c.counted)] == []


OF_NO_UNITS = {"parameter_budget_deviation", "strata_effect"}
"""Shares that are of no sample: of the parameters of a network, and of all variables together."""


@pytest.mark.parametrize("gate", "ABCD")
def test_a_share_says_how_many_it_is_of_also_without_an_interval(ladder, gate):
    shares = [c for c in judge(ladder, gate).criteria
              if c.measured is not None and human(c, c.measured).endswith(" %")]  # fmt: skip
    assert shares
    unsaid = [c.id for c in shares if not COUNTED.fullmatch(c.counted)]
    assert set(unsaid) <= OF_NO_UNITS


def test_a_share_names_the_units_that_it_is_of(ladder):
    """Half of the starts away: the count follows the evidence, not the plan."""
    rows = {c.id: c for c in judge(ladder, "C").criteria if c.candidate == "flow"}
    few = rows["stub_violation_upper"]
    assert few.counted == "0 of 400 observations"
    evidence.edit_table(ladder, "shadow/stub.parquet", lambda f: f.assign(delivered=399))
    rows = {c.id: c for c in judge(ladder, "C").criteria if c.candidate == "flow"}
    assert rows["stub_violation_upper"].counted == "0 of 399 observations"


def test_the_desk_and_the_page_show_what_a_number_rests_on(ladder):
    report = write_gate(ladder, "C")
    write_index(ladder)
    counted = next(c.counted for c in report.criteria if c.id == "admissible_share")
    for page in ("index", "gate_c"):
        assert counted in (ladder / f"reports/{page}.html").read_text()


ALL_OF = {
    ("A", "refused_recordings_accounted"): "50 recordings",
    ("A", "unasked_checks"): "3 questions",
    ("A", "clock_residual_s"): "4 clocks, one a stream and epoch",
    ("A", "calibration_residual_m"): "2 calibration epochs",
    ("A", "data_defects"): "3 numbers",
    ("A", "strata_effect"): "3 variables",
    ("A", "baselines_matched"): "7 simpler policies",
    ("A", "factors_isolated"): "5 variants",
    ("B", "samples_difference"): "8 samples",
    ("C", "checker_violations"): "1000 actions",
    ("C", "mutants_undetected"): "265 mutants",
    ("D", "checker_violations"): "5000 actions",
}
"""By hand, from the evidence: what is asked of everything that there is, and how much that is."""


@pytest.mark.parametrize("gate", "ABCD")
def test_what_is_asked_of_everything_says_how_much_that_is_and_is_no_small_sample(judged, gate):
    report = judged(gate)
    counted = {(gate, c.id): c.counted for c in report.criteria}
    assert {key: counted[key] for key in ALL_OF if key[0] == gate} == {
        key: f"all {said}" for key, said in ALL_OF.items() if key[0] == gate
    }
    small = [doubt.text for doubt in few_units(report)]
    assert not any(f"{name} (" in text for text in small for _, name in ALL_OF)


def test_a_count_of_situations_says_of_how_many_episodes_they_are(judged):
    counted = {c.id: c.counted for c in judged("A").criteria}
    assert re.fullmatch(r"\d+ episodes", counted["held_out_situations"])
    assert re.fullmatch(r"\d+ episodes", counted["multimodal_situations"])


def test_a_number_that_counts_no_units_says_of_how_many_rows_it_is(ladder):
    """On the desk, at its bar."""
    report = write_gate(ladder, "A")
    write_index(ladder)
    text = (ladder / "reports/index.html").read_text()
    rows = rows_of(ladder, report)
    frame = pd.read_parquet(ladder / "artifacts/audit/clocks.parquet")
    named = {c.id: c for c in report.criteria}
    assert rows.rests_on(named["lag_spread_rows"]) == f"{len(frame)} rows"
    assert rows.rests_on(named["cause_accepted"]).endswith(" tables")
    assert rows.rests_on(named["label_disagreement"]) == "none of 40 replays"
    shown = [row.partition("</tr>")[0] for row in text.split("<tr")[1:]]
    shown = [row for row in shown if "#lag_spread_rows" in row]
    assert len(shown) == 2, "its bar, and beside its owner's name"
    assert f"<td>{len(frame)} rows</td>" in shown[0]
    assert f"<small>{len(frame)} rows</small>" in shown[1]
