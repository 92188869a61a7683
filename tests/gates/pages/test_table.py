"""What the page and the summary say about what decided: waived, counted, with units."""

import evidence
import pytest

from gates.pages.guide import QUESTIONS, READING, USED, WORDS, label, unit
from gates.pages.page import index_page
from gates.pages.summary import markdown
from gates.pages.table import deciding, groups, passed_by, stops, tally, waived
from gates.writing import write_gate


def _no_recovery(ladder):
    evidence.edit_table(
        ladder, "audit/recovery.parquet", lambda f: f.assign(successes=f["episodes"])
    )
    return write_gate(ladder, "A")


def test_a_failed_route_is_said_not_to_count(ladder):
    report = _no_recovery(ladder)
    failed = [c for c in report.criteria if c.verdict == "FAIL"]
    assert report.verdict == "PASS" and [c.id for c in failed] == ["recovery_benefit"]
    assert waived(failed[0], report) == "not needed: route valid modes holds"
    assert passed_by(report) == "every required criterion holds, by route valid modes"
    assert tally(report) == "20 of 21 hold; 1 fails (without weight for the verdict)"
    page = (ladder / "reports/gate_a.html").read_text()
    assert "not needed: route valid modes holds" in page and "1 fails" in markdown(report)


def test_a_required_failure_is_never_waived(ladder):
    evidence.edit_table(ladder, "audit/clocks.parquet", lambda f: f.assign(offset_after_s=0.5))
    report = write_gate(ladder, "A")
    (failed,) = [c for c in report.criteria if c.verdict == "FAIL"]
    assert waived(failed, report) == ""
    assert deciding(report) == "clock_residual_s: 0.5 s, required ≤ 0.01 s"
    assert passed_by(report) == ""
    text = markdown(report)
    assert text.index("## Not met") < text.index("All 21 criteria")


def test_a_candidate_that_stops_names_its_criterion(ladder):
    def slow(frame):
        hit = (frame["method"] == "diffusion") & (frame["run"] == 2)
        return frame.assign(seconds=frame["seconds"].where(~hit, frame["seconds"] * 9))

    evidence.edit_table(ladder, "latency/latency.parquet", slow)
    report = write_gate(ladder, "B")
    assert report.verdict == "PASS" and report.candidates["diffusion"] == "FAIL"
    why = stops(report)
    assert why["flow"] == "" and why["diffusion"].startswith("latency_median_ratio: ")
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


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("clock_residual_s", "s"),
        ("lag_spread_steps", "action steps"),
        ("projection_p95_m", "m"),
        ("boundary_jerk_p95_m_s3", "m/s³"),
        ("force_peak_p95_n", "N"),
        ("mode_success_lower", ""),
        ("unmatched_starts", ""),
        ("held_out_situations", ""),
    ],
)
def test_units_follow_the_suffix(name, text):
    assert unit(name) == text


def test_every_gate_has_a_reading_guide_whose_words_exist():
    assert set(QUESTIONS) == set(READING) == set(USED) == set("ABCDE")
    assert {word for used in USED.values() for word in used} == set(WORDS)


def test_fields_of_the_card_carry_their_unit(ladder):
    assert label("speed_limit_m_s") == "speed limit, m/s"
    assert label("force_limit_n") == "force limit, N"
    assert label("stop_path") == "stop path"
    write_gate(ladder, "E")
    page = (ladder / "reports/gate_e.html").read_text()
    assert "speed limit, m/s" in page and "<div>0.35, -0.2, 0.03</div>" in page
    assert page.index("The card (draft, not signed)") < page.index("<h2>Criteria</h2>")
