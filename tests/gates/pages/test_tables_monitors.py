"""The table of monitors: controls marked, severities apart, alarm and recovery together."""

import evidence
import pytest

from gates.evidence import Evidence, MissingEvidenceError
from gates.pages.figures import draw_all
from gates.pages.tables_monitors import UNAVAILABLE, WATCHED
from gates.proof import judge
from gates.stress.monitors import ALARMS, UNWATCHED
from genpolicy.evidence.rows.monitors import MonitorAlarmRow, MonitorUnavailableRow
from genpolicy.integrity.rows import read_rows, write_rows


@pytest.fixture
def tables(whole, judged):
    """The listed table and the folded ones, by name; lines without their heads."""
    found = Evidence(whole)
    report = judged("D")
    folded = {item.summary: item.read(found, report)[1:] for item in WATCHED.folded}
    return {"": WATCHED.read(found, report)[1:], **folded}


def test_each_monitor_stands_beside_both_controls_and_both_ends_of_the_cost(tables):
    own = [line[1] for line in tables[""] if line[0] == "flow"]
    assert own == [
        "support", "time_in_episode (control)", "sample_variance (control)",
        "never an alarm", "always an alarm",
    ]  # fmt: skip
    support = next(line for line in tables[""] if line[:2] == ("flow", "support"))
    assert support[2] == "6"
    assert support[3].startswith("100 % (")
    assert support[-2:] == ("2", "1.6")


def test_severities_stand_apart(tables):
    graded = [line[1:4] for line in tables["By probe and severity"] if line[0] == "flow"]
    assert ("lighting", "1", "support") in graded
    assert ("lighting", "2", "support") in graded
    assert ("contact_anomaly", "2", "sample_variance") in graded
    assert all(line[4] == "4" for line in tables["By probe and severity"])


def test_alarm_recovery_and_phase_are_counted_together(tables):
    """12 successes and 8 failures with a failed recovery, 6 of them alarmed in the insertion."""
    joint = {line[:3]: line[3:] for line in tables["Alarm, recovery and phase together"]}
    assert joint["flow", "support", "insert"] == ("0", "0", "0", "6")
    assert joint["flow", "support", "none"] == ("12", "0", "0", "2")


def test_costs_have_owners_and_who_cannot_watch_says_why(tables):
    assert ("missed_failure", "10", "safety", "test") in tables["The cost matrix"]
    (first, *_) = tables["Monitors that cannot watch a method"]
    assert first[1] == "seed_disagreement" and "one seed" in first[2]


def test_a_table_that_the_report_does_not_name_is_not_shown(ladder, judged):
    report = judged("D")
    write_rows(ladder / ALARMS, MonitorAlarmRow, read_rows(ladder / ALARMS, MonitorAlarmRow)[:-1])
    with pytest.raises(MissingEvidenceError, match="not the file that the report names"):
        WATCHED.read(Evidence(ladder), report)


def test_what_was_not_run_is_said(ladder):
    write_rows(ladder / ALARMS, MonitorAlarmRow, [])
    write_rows(ladder / UNAVAILABLE, MonitorUnavailableRow, [])
    evidence.record(ladder)
    report = judge(ladder, "D")
    found = Evidence(ladder)
    (shown,) = draw_all([WATCHED], found, report)
    assert not shown.skipped
    assert [line[:2] for line in shown.listed[1:]] == [
        (name, UNWATCHED) for name in report.candidates
    ]
    assert all(table for _, table in shown.folded)


def test_a_candidate_without_rows_is_said_beside_the_others(ladder):
    rows = [r for r in read_rows(ladder / ALARMS, MonitorAlarmRow) if r.method == "flow"]
    write_rows(ladder / ALARMS, MonitorAlarmRow, rows)
    evidence.record(ladder)
    lines = WATCHED.read(Evidence(ladder), judge(ladder, "D"))
    (line,) = [one for one in lines if one[0] == "diffusion"]
    assert "not looked at" in line[1] and "has no rows of diffusion" in line[1]


def test_the_page_shows_the_table_of_a_run(whole, judged):
    """What it reads is bound by the report of the run; else the page would say that it is not."""
    (shown,) = draw_all([WATCHED], Evidence(whole), judged("D"))
    assert not shown.skipped
    assert len(shown.listed) > 1 and len(shown.folded) == 4
