"""What monitors would have said, counted by hand from the planned evidence; nothing is judged."""

import math
from dataclasses import replace

import evidence
import pandas as pd
import pytest
import watched

from gates.evidence import Evidence, MissingEvidenceError
from gates.proof import SPECS, judge
from gates.settings import read_params, read_settings
from gates.stress.monitors import (
    ALARMS,
    BLIND,
    NO_AUTHORITY,
    UNWATCHED,
    by_rollout,
    cases,
    felt,
    share,
    watched_of,
)
from gates.stress.rollouts import StressSettings
from genpolicy.errors import IntegrityError
from genpolicy.evidence.rows.monitors import MonitorAlarmRow
from genpolicy.integrity.rows import read_rows, write_rows
from genpolicy.monitors.names import TIME, VARIANCE
from genpolicy.statistics.intervals import clopper_pearson


@pytest.fixture
def settings(ladder):
    return read_settings(read_params(ladder), "gate_d", StressSettings)


def of(ladder, settings, candidate="flow"):
    return watched_of(Evidence(ladder), settings, candidate)


def test_coverage_counts_failures_that_were_alarmed(ladder, settings):
    """Six of twelve probe rollouts fail, all of them in the insertion, where support says 9."""
    support, clock, spread = of(ladder, settings).watched
    assert (support.monitor, clock.monitor) == ("support", "time_in_episode")
    assert support.failures == 6
    assert support.coverage[0] == 1.0
    assert clock.coverage[0] == 1.0  # failures take 12 s, no success more than 4
    assert spread.coverage[0] == 0.0


def test_delay_counts_from_where_a_probe_is_felt(ladder, settings):
    """Light from the start: 2 s until the insertion. Friction: from the insertion on, none."""
    support, clock, _ = of(ladder, settings).watched
    assert support.delay_s == 2.0  # of 2, 2, 2, 2, 0, 0
    assert clock.delay_s == 4.0  # above 3.5 s, of 4, 4, 4, 4, 2, 2


def test_false_alarms_are_of_successes_that_set_no_threshold(ladder, settings):
    """Six of eight judged episodes succeed; their starts are among those of the thresholds."""
    support, clock, _ = of(ladder, settings).watched
    assert (support.successes, support.false_alarms[0], clock.false_alarms[0]) == (6, 0.0, 0.0)
    assert support.false_alarms[2] > 0.3, "six bound a share by little"
    assert support.allowed == 0.1


def test_cost_by_hand(ladder, settings):
    """20 rollouts, 8 fail: 6 under probes and 2 judged, of which support misses the two.

    (6 x 2 + 2 x 10) / 20; never an alarm 8 x 10 / 20; always one (8 x 2 + 12 x 1) / 20.
    """
    found = of(ladder, settings)
    assert found.watched[0].cost == pytest.approx(1.6)
    assert (found.quiet_cost, found.loud_cost) == (pytest.approx(4.0), pytest.approx(1.4))


def test_without_a_matrix_nothing_costs(ladder):
    evidence.write_params(ladder, lambda p: p["gate_d"].pop("monitor_costs"))
    settings = read_settings(read_params(ladder), "gate_d", StressSettings)
    found = of(ladder, settings)
    assert found.quiet_cost is None
    assert all(one.cost is None for one in found.watched)


def test_a_monitor_that_does_as_the_clock_is_not_better(ladder, settings):
    assert of(ladder, settings).better_than_controls == ()


def test_no_alarm_is_of_no_phase(ladder, settings):
    rows = by_rollout(Evidence(ladder).of(ALARMS, MonitorAlarmRow, "flow"))
    assert set(rows[rows["alarm"]]["phase"]) == {"insert"}
    assert set(rows[~rows["alarm"]]["phase"]) == {""}
    assert len(felt(rows)) == 3 * 12


def test_who_never_got_to_where_a_probe_is_felt_is_no_case(ladder, settings):
    path = ladder / ALARMS
    rows = read_rows(path, MonitorAlarmRow)
    cut = [row for row in rows if not (row.family == "contact_anomaly" and row.phase == "insert")]

    gone = {"onset_s": None, "score_max": None}
    write_rows(
        path,
        MonitorAlarmRow,
        [replace(r, **gone) if r.family == "contact_anomaly" else r for r in cut],
    )
    assert of(ladder, settings).watched[0].failures == 4


FAMILY = "contact_anomaly"


def never_felt(ladder, *, failing=lambda start: start % 2 == 1, kept=("lighting", FAMILY)):
    """Rollouts of the family in which friction is felt time out before the insertion."""
    gone = {"onset_s": None, "score_max": None, "alarm": False, "first_alarm_s": None}
    found = []
    for row in read_rows(ladder / ALARMS, MonitorAlarmRow):
        if row.family not in (*kept, "nominal") or (row.family, row.phase) == (FAMILY, "insert"):
            continue
        fails = failing(row.start)
        ended = {"success": not fails, "outcome": "timeout" if fails else "success"}
        changed = {**gone, "delay_s": None, **ended} if row.family == FAMILY else {}
        found.append(replace(row, **changed))
    write_rows(ladder / ALARMS, MonitorAlarmRow, found)
    evidence.record(ladder)


def test_what_was_never_felt_costs_no_monitor_anything(ladder, settings):
    """16 cases, of which 4 fail under probes and 2 judged; the 4 others are none, 2 of which fail.

    (4 x 2 + 2 x 10) / 16; never an alarm 6 x 10 / 16; always one (6 x 2 + 10 x 1) / 16. Charged
    with all 20, whoever always alarms would be excused of two failures that nobody could see.
    """
    never_felt(ladder)
    found = of(ladder, settings)
    assert found.failed_before == 2
    assert found.watched[0].cost == pytest.approx(1.75)
    assert (found.quiet_cost, found.loud_cost) == (pytest.approx(3.75), pytest.approx(1.375))
    rows = by_rollout(Evidence(ladder).of(ALARMS, MonitorAlarmRow, "flow"))
    assert len(cases(rows)) == 3 * 16 and len(rows) == 3 * 20


def test_failures_before_a_probe_is_felt_are_not_called_no_failures(ladder):
    """Four of four time out in the approach; nothing that could be felt made it fail."""
    never_felt(ladder, failing=lambda start: True, kept=(FAMILY,))
    (said,) = [text for text in judge(ladder, "D").caveats if text.startswith("flow: under")]
    assert said == (
        "flow: under probes 4 failed before the probe could be felt, and none after, so that what "
        "a monitor would miss was not seen."
    )


def test_that_no_probe_made_it_fail_is_said_where_none_did(ladder):
    never_felt(ladder, failing=lambda start: False, kept=(FAMILY,))
    said = "flow: no probe made it fail, so that what a monitor would miss was not seen."
    assert said in judge(ladder, "D").caveats


def test_failures_that_are_no_case_are_told_beside_those_that_are(ladder):
    never_felt(ladder)
    (said,) = [text for text in judge(ladder, "D").caveats if text.startswith("flow: of 4 fail")]
    assert said.endswith("; 2 failed before the probe could be felt and are no case.")


def test_nothing_run_is_nothing_known(ladder, settings):
    write_rows(ladder / ALARMS, MonitorAlarmRow, [])
    with pytest.raises(MissingEvidenceError, match="has no rows"):
        of(ladder, settings)
    evidence.record(ladder)
    caveats = judge(ladder, "D").caveats
    assert sum(text.endswith(f": {UNWATCHED}.") for text in caveats) == 2


def test_a_table_without_rows_of_one_candidate_is_not_called_a_run_without_probes(ladder):
    rows = [row for row in read_rows(ladder / ALARMS, MonitorAlarmRow) if row.method == "flow"]
    write_rows(ladder / ALARMS, MonitorAlarmRow, rows)
    evidence.record(ladder)
    (said,) = [text for text in judge(ladder, "D").caveats if text.startswith("diffusion: no mon")]
    assert "has no rows of diffusion" in said and UNWATCHED not in said


def test_bytes_that_are_no_table_refuse(ladder):
    (ladder / ALARMS).write_bytes(b"no table")
    evidence.record(ladder)
    with pytest.raises(IntegrityError, match="alarms"):
        judge(ladder, "D")


def only(ladder, *monitors):
    rows = [row for row in read_rows(ladder / ALARMS, MonitorAlarmRow) if row.monitor in monitors]
    write_rows(ladder / ALARMS, MonitorAlarmRow, rows)
    evidence.record(ladder)
    return [text for text in judge(ladder, "D").caveats if text.startswith("flow: ")]


def test_where_no_monitor_could_watch_it_is_said(ladder):
    """One training seed and `seed_disagreement` alone, or weights that are not known here."""
    assert f"flow: {BLIND}." in only(ladder, TIME, VARIANCE)


def test_controls_are_named_that_were_there(ladder):
    """Who draws one chunk at a time has no spread, and none is spoken of."""
    (said,) = [text for text in only(ladder, "support", TIME) if "failures under probes" in text]
    assert said.endswith("no monitor is shown to cover more than the clock.")


def test_the_report_says_that_no_monitor_has_authority_and_no_criterion_hangs_on_one(ladder):
    report = judge(ladder, "D")
    assert NO_AUTHORITY in report.caveats
    (text,) = [one for one in report.caveats if one.startswith("flow: of 6 failures")]
    assert "no monitor is shown to cover more than the clock" in text
    assert not [item.id for item in SPECS["D"].criteria if "monitor" in item.id]
    without = {answer.id: answer.verdict for answer in report.criteria}
    write_rows(ladder / ALARMS, MonitorAlarmRow, [])
    evidence.record(ladder)
    again = judge(ladder, "D")
    assert {answer.id: answer.verdict for answer in again.criteria} == without
    assert again.verdict == report.verdict


def test_planned_evidence_is_what_this_file_says():
    assert sum(watched.succeeds("judged", start) for start in range(8)) == 6
    assert math.isclose(len(watched.rollouts()), 2 * (12 + 8 + 12))


def test_a_count_of_starts_that_is_no_whole_number_is_wide_to_both_sides():
    """One alarm in three rollouts of two starts is two thirds of a start: none below, one above.

    Rounded down alone, false alarms would be bounded as if there had been none.
    """
    rows = pd.DataFrame({"alarm": [True, False, False], "start": [0, 0, 1]})
    none, one = (clopper_pearson(hits, 2, 0.95) for hits in (0, 1))
    assert share(rows, 0.95) == (pytest.approx(1 / 3), none[0], one[1])
