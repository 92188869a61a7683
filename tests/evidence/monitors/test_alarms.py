"""Thresholds and alarms by hand, and how often a monitor that knows nothing raises one."""

from dataclasses import replace

import numpy as np
import pytest

from genpolicy.evidence.monitors.alarms import alarm_rows, threshold_rows
from genpolicy.evidence.monitors.settings import MonitorsSettings
from genpolicy.evidence.rows.monitors import MonitorScoreRow
from genpolicy.evidence.rows.stress import RolloutRow
from genpolicy.monitors.names import TIME

SETTINGS = MonitorsSettings(
    kinds=["support"], alpha=0.5, threshold_starts=3, judged_starts=1, probe_starts=1,
    probes={"light": {"severities": [1.0]}, "friction": {"severities": [1.0], "felt": "contact"}},
)  # fmt: skip


def rollout(condition, start, *, success=True):
    return RolloutRow(
        method="flow", seed=0, perturbation=condition, start=start, start_sha256="",
        success=success, outcome="success" if success else "timeout",
        duration_s=4.0, ticks=80, action_ticks=80,
        hold_ticks=0, fallback_ticks=0, invocations=4, deadline_misses=0, discards=0, rejections=0,
        rejected_by="", recovery_attempted=not success, recovered=False, interventions=0,
        action_age_p50_s=None, action_age_p95_s=None, action_age_max_s=None, latency_p95_s=None,
        force_peak_n=0.0, mode="", person_s=0.0,
    )  # fmt: skip


def scored(condition, start, values, *, monitor="support"):
    """Invocations each second, `insert` from 2 s on."""
    return [
        MonitorScoreRow(
            "flow", condition, start, number, float(number),
            "insert" if number >= 2 else "approach", monitor, float(value),
        )
        for number, value in enumerate(values)
    ]  # fmt: skip


def clocked(condition, start, values):
    clock = scored(condition, start, range(len(values)), monitor=TIME)
    return [*scored(condition, start, values), *clock]


@pytest.fixture
def above():
    """Maxima 2, 4, 6 in the approach and 1, 1, 1 in the insertion: rank 2 of 3 at alpha .5."""
    rows = [row for start, top in enumerate((2, 4, 6)) for row in clocked(
        "thresholds", start, [0, top, 1, 1])]  # fmt: skip
    ends = [rollout("thresholds", start) for start in range(3)]
    return threshold_rows(rows, ends, alpha=0.5, phases=("approach", "insert", "retreat"))


def of(rows, monitor="support"):
    return [row for row in rows if row.monitor == monitor]


def test_a_threshold_is_of_the_largest_scores_of_a_phase(above):
    approach, insert, retreat = of(above)
    assert (approach.threshold, approach.rank, approach.episodes) == (4.0, 2, 3)
    assert insert.threshold == 1.0
    assert (retreat.threshold, retreat.rank, retreat.episodes) == (None, 1, 0)


def test_a_failed_episode_sets_no_threshold():
    rows = [*clocked("thresholds", 0, [0, 9]), *clocked("thresholds", 1, [0, 2])]
    ends = [rollout("thresholds", 0, success=False), rollout("thresholds", 1)]
    (row,) = of(threshold_rows(rows, ends, alpha=0.5, phases=("approach",)))
    assert (row.threshold, row.episodes) == (2.0, 1)


def test_scores_of_other_conditions_say_nothing_of_thresholds():
    """The stage has those of the thresholds alone, and who verifies has all: the same rows."""
    rows, ends = clocked("thresholds", 0, [0, 2]), [rollout("thresholds", 0)]
    late = scored("judged", 0, [9, 9], monitor="own_loss")
    both = [*ends, rollout("judged", 0)]
    alone = threshold_rows(rows, ends, alpha=0.5, phases=("approach",))
    assert threshold_rows([*rows, *late], both, alpha=0.5, phases=("approach",)) == alone


def alarms(rows, ends, above):
    found = alarm_rows(rows, ends, above, SETTINGS, contact_phases=frozenset({"insert"}))
    return {(row.family, row.phase): row for row in of(found)}


def test_first_alarm_and_delay_from_the_start(above):
    found = alarms(clocked("light@1", 0, [5, 4, 1, 2]), [rollout("light@1", 0)], above)
    approach, insert = found["light", "approach"], found["light", "insert"]
    assert (approach.alarm, approach.first_alarm_s, approach.delay_s) == (True, 0.0, 0.0)
    assert (insert.alarm, insert.first_alarm_s, insert.delay_s) == (True, 3.0, 3.0)
    assert approach.severity == 1.0 and approach.score_max == 5.0


def test_a_score_at_its_threshold_is_no_alarm(above):
    found = alarms(clocked("judged", 0, [4, 4, 1, 1]), [rollout("judged", 0)], above)
    assert not any(row.alarm for row in found.values())
    assert found["nominal", "insert"].first_alarm_s is None


def test_before_a_probe_is_felt_nothing_counts(above):
    rows, ends = clocked("friction@1", 0, [9, 9, 1, 2]), [rollout("friction@1", 0)]
    found = alarms(rows, ends, above)
    approach, insert = found["friction", "approach"], found["friction", "insert"]
    assert (approach.alarm, approach.score_max) == (False, None)
    assert (insert.onset_s, insert.first_alarm_s, insert.delay_s) == (2.0, 3.0, 1.0)


def test_who_never_gets_there_has_no_onset(above):
    found = alarms(clocked("friction@1", 0, [9, 9]), [rollout("friction@1", 0)], above)
    assert found["friction", "approach"].onset_s is None
    assert not found["friction", "approach"].alarm


def test_rollouts_of_thresholds_are_judged_by_nothing(above):
    rows, end = clocked("thresholds", 0, [99, 99]), rollout("thresholds", 0)
    assert alarms(rows, [end], above) == {}
    other = replace(end, perturbation="judged")
    rows = [replace(row, condition="judged") for row in rows]
    assert alarms(rows, [other], above)["nominal", "approach"].alarm


def test_false_alarms_of_a_monitor_that_knows_nothing_are_at_most_alpha():
    """2,000 times 12 episodes for a threshold and one to be judged: noise alone."""
    rng, wrong, trials = np.random.default_rng(1), 0, 2000
    for _ in range(trials):
        draws = rng.normal(size=(13, 3)).max(axis=1)
        rows = [row for n, top in enumerate(draws[:12]) for row in scored("thresholds", n, [top])]
        ends = [rollout("thresholds", n) for n in range(12)]
        above = threshold_rows(rows, ends, alpha=0.1, phases=("approach",))
        late = clocked("judged", 0, [draws[12]])
        wrong += alarms(late, [rollout("judged", 0)], above)["nominal", "approach"].alarm
    assert 0.05 < wrong / trials <= 0.1 + 4 * (0.09 / trials) ** 0.5
