"""What the page and the summary say about what decided: waived, counted, with units."""

import html
import re
from types import SimpleNamespace

import evidence
import pytest

from gates.pages.page import index_page
from gates.pages.summary import markdown
from gates.pages.table import columns, deciding, groups, not_asked, passed_by, stops, tally, waived
from gates.writing import write_gate


def test_a_required_failure_is_never_waived(ladder):
    evidence.edit_table(ladder, "audit/clocks.parquet", evidence.lags_apart)
    report = write_gate(ladder, "A")
    (failed,) = [c for c in report.criteria if c.verdict == "FAIL"]
    assert waived(failed, report) == ""
    assert deciding(report) == "lag_spread_rows: 4 action steps, required ≤ 1 action step"
    assert passed_by(report) == "" and tally(report) == "23 of 24 hold; 1 fails"
    text = markdown(report)
    assert text.index("## Not met") < text.index("All 24 criteria")


def test_a_candidate_that_stops_names_its_criterion(ladder):
    def slow(frame):
        hit = (frame["method"] == "diffusion") & (frame["run"] == 2)
        hit &= frame["source"] == "measured"  # what is declared stays between its ends
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
        assert "latency" in text and "required ≤ ×1.5" in text


def _waive(params):
    del params["gate_a"]["limits"]["perception"]["calibration_residual_m"]
    params["gate_a"]["not_applicable"] = {"perception": {"calibration_residual_m": "no camera"}}
    params["gate_a"]["waived_checks"] = {"model": {"operator": "one person demonstrated"}}


def test_who_answers_for_what_was_not_asked_stands_above_the_good_news(ladder):
    """Wrong before: a waiver was the last line of a page that said PASS in its first."""
    evidence.write_params(ladder, _waive)
    report = write_gate(ladder, "A")
    page = html.unescape((ladder / "reports/gate_a.html").read_text())
    for text, below in ((page, "Read this page"), (plain_again(markdown(report)), "All 23")):
        top = text[: text.index(below)]
        assert "calibration_residual_m was not asked: the perception owner" in top
        assert "operator need not be asked of the data: the model owner" in top
        assert "(no camera)" in top and "(one person demonstrated)" in top
    assert len(not_asked(report)) == 2


def test_where_everything_was_asked_nobody_answers_for_a_gap(ladder):
    report = write_gate(ladder, "A")
    assert not_asked(report) == () and "Not asked" not in markdown(report)
    assert "<dt>Not asked</dt>" not in (ladder / "reports/gate_a.html").read_text()


def plain_again(text: str) -> str:
    """A summary as a reader sees it."""
    return html.unescape(re.sub(r"\\(.)", r"\1", text))


@pytest.mark.parametrize("gate", "ABCD")
def test_groups_hold_every_criterion_once_in_order(ladder, gate):
    report = write_gate(ladder, gate)
    lines = [line.criterion for group in groups(report) for line in group.lines]
    assert lines == list(report.criteria)
    assert len({group.id for group in groups(report)}) == len(groups(report))
    for group in groups(report):
        asked = [line.criterion.candidate for line in group.lines]
        whole = asked == [None]
        for who in columns(report):
            line = group.of(who)
            assert line is None or line.criterion.candidate == (None if whole else who)
            assert (line is None) == (not whole and who not in asked)
        assert set(group.evidence) == {p for line in group.lines for p in line.criterion.evidence}


def test_what_is_not_decided_is_told_from_what_was_not_measured():
    def of(verdict, interval=None):
        return SimpleNamespace(id="held", verdict=verdict, interval=interval, candidate=None)

    criteria = [of("PASS"), of("INCONCLUSIVE", (0.1, 0.2)), of("INCONCLUSIVE"), of("INCONCLUSIVE")]
    report = SimpleNamespace(gate="D", criteria=criteria, verdict="INCONCLUSIVE", overrides=())
    assert tally(report) == "1 of 4 hold; 1 not decided; 2 not measured"
