"""What the page and the summary say about what decided: waived, counted, with units."""

from types import SimpleNamespace

import evidence
import pytest

from gates.pages.page import index_page
from gates.pages.summary import markdown
from gates.pages.table import deciding, groups, passed_by, stops, tally, waived
from gates.writing import write_gate


def test_a_required_failure_is_never_waived(ladder):
    evidence.edit_table(ladder, "audit/clocks.parquet", evidence.lags_apart)
    report = write_gate(ladder, "A")
    (failed,) = [c for c in report.criteria if c.verdict == "FAIL"]
    assert waived(failed, report) == ""
    assert deciding(report) == "lag_spread_steps: 4 action steps, required ≤ 1 action steps"
    assert passed_by(report) == "" and tally(report) == "23 of 24 hold; 1 fails"
    text = markdown(report)
    assert text.index("## Not met") < text.index("All 24 criteria")


def test_a_candidate_that_stops_names_its_criterion(ladder):
    def slow(frame):
        hit = (frame["method"] == "diffusion") & (frame["run"] == 2)
        return frame.assign(seconds=frame["seconds"].where(~hit, frame["seconds"] * 9))

    evidence.edit_table(ladder, "latency/latency.parquet", slow)
    report = write_gate(ladder, "B")
    assert report.verdict == "PASS" and report.candidates["diffusion"] == "FAIL"
    why = stops(report)
    assert why["flow"] == "" and why["diffusion"].startswith("warm_latency_ratio_upper: ")
    failed = next(c for c in report.criteria if c.verdict == "FAIL")
    assert waived(failed, report) == "stops diffusion only"
    assert passed_by(report) == "every required criterion holds; flow passes whole"
    for text in (
        index_page(ladder),
        markdown(report),
        (ladder / "reports/gate_b.html").read_text(),
    ):
        assert "latency" in text and "required ≤ 1.5" in text


@pytest.mark.parametrize("gate", "ABCD")
def test_groups_hold_every_criterion_once_in_order(ladder, gate):
    report = write_gate(ladder, gate)
    lines = [line.criterion for group in groups(report) for line in group.lines]
    assert lines == list(report.criteria)
    assert len({group.id for group in groups(report)}) == len(groups(report))


def test_what_is_not_decided_is_told_from_what_was_not_measured():
    def of(verdict, interval=None):
        return SimpleNamespace(verdict=verdict, interval=interval, candidate=None)

    criteria = [of("PASS"), of("INCONCLUSIVE", (0.1, 0.2)), of("INCONCLUSIVE"), of("INCONCLUSIVE")]
    report = SimpleNamespace(criteria=criteria, verdict="INCONCLUSIVE")
    assert tally(report) == "1 of 4 hold; 1 not decided; 2 not measured"
