"""Incidents on the way: counted by the one reason, nothing moves, a copy once, none left out."""

import evidence
import pandas as pd
import pytest
from asked import asked
from editing import cells

from gates.asked_for import INCIDENTS_ASKED_FOR, OF_TWO
from gates.evidence import MissingEvidenceError
from gates.feasibility.incidents import incidents_miscounted
from gates.proof import judge
from gates.writing import write_gate

FEW = ("phase_change_on_the_way", "delay_on_the_way", *OF_TWO)
COUNTS, STUB = "shadow/counts.parquet", "shadow/stub.parquet"


def of(name):
    return lambda f: (f["method"] == "flow") & (f["fixture"] == name)


def told(root):
    return asked(root, incidents_miscounted, "flow", gate="C")


def test_twelve_of_each_are_counted_and_none_moved(ladder):
    found = told(ladder)
    assert found.value == 0.0
    assert found.caveat == f"{len(INCIDENTS_ASKED_FOR)} incidents, each to 12 chunks or more"


@pytest.mark.parametrize("name", FEW)
@pytest.mark.parametrize(
    ("table", "column", "value", "wrong"),
    [(COUNTS, "reason", "superseded", 12), (COUNTS, "count", 11, 1), (COUNTS, "count", 13, 1)],
)
def test_what_is_counted_otherwise_is_wrong_whichever_it_is(
    ladder, name, table, column, value, wrong
):
    evidence.edit_table(ladder, table, cells(column, value, where=of(name)))
    found = told(ladder)
    assert found.value == wrong and f"{name}: " in found.caveat


@pytest.mark.parametrize("name", FEW[:2])
@pytest.mark.parametrize(("table", "column"), [(COUNTS, "executed"), (STUB, "arrivals")])
def test_nothing_of_it_moves(ladder, name, table, column):
    evidence.edit_table(ladder, table, cells(column, 2, where=of(name)))
    found = told(ladder)
    assert found.value == 2.0 and "2 got to the stub" in found.caveat
    report = judge(ladder, "C")
    assert report.candidates["flow"] == "FAIL" and report.candidates["diffusion"] == "PASS"


@pytest.mark.parametrize(("executed", "wrong"), [(11, 1), (13, 1), (24, 12)])
def test_of_copies_exactly_one_is_executed(ladder, executed, wrong):
    evidence.edit_table(ladder, COUNTS, cells("executed", executed, where=of(OF_TWO[0])))
    assert told(ladder).value == wrong


@pytest.mark.parametrize("column", ["stale", "invalid"])
def test_nothing_of_a_copy_is_refused_at_the_stub(ladder, column):
    evidence.edit_table(ladder, STUB, cells(column, 3, where=of(OF_TWO[0])))
    assert told(ladder).value == 3.0


@pytest.mark.parametrize("name", FEW)
def test_one_that_was_not_tried_leaves_no_verdict(ladder, name):
    evidence.edit_table(ladder, COUNTS, lambda f: f[~of(name)(f)])
    with pytest.raises(MissingEvidenceError, match=f"not tried: {name}"):
        told(ladder)


def test_none_of_none_is_no_evidence(ladder):
    def none(frame):
        rows = of("reset_on_the_way")(frame)
        return frame.assign(**{
            column: frame[column].where(~rows, 0) for column in ("generated", "executed", "count")
        })  # fmt: skip

    evidence.edit_table(ladder, COUNTS, none)
    with pytest.raises(MissingEvidenceError, match="not tried: reset_on_the_way"):
        told(ladder)


def test_several_totals_of_one_incident_are_no_evidence(ladder):
    def twice(frame):
        again = frame[of("delay_on_the_way")(frame)].assign(reason="reset", generated=13)
        return pd.concat([frame, again])

    evidence.edit_table(ladder, COUNTS, twice)
    with pytest.raises(MissingEvidenceError, match="delay_on_the_way states several totals"):
        told(ladder)


def test_the_page_shows_what_was_expected_and_seen(ladder):
    evidence.edit_table(ladder, COUNTS, cells("count", 11, where=of("delay_on_the_way")))
    write_gate(ladder, "C")
    page = (ladder / "reports/gate_c.html").read_text()
    assert "What happens on the way" in page
    assert "11 of 12" in page and "calibration mismatch" in page
