"""Starts of thresholds, of false alarms, of probes and of the comparison: four streams."""

from dataclasses import replace

import pytest

from genpolicy.candidates.joining import JoiningSettings
from genpolicy.errors import ConfigError
from genpolicy.evidence.monitors.plan import (
    plan_judged,
    plan_thresholds,
    require_runnable,
    start_hashes,
    starts_of,
)
from genpolicy.evidence.monitors.settings import MonitorsSettings, ProbeFamily
from genpolicy.evidence.stress.matched import matched_starts


def planned(bench, task, tmp_path, plan, **changes):
    comparison = replace(bench.comparison, **changes)
    return plan(
        comparison, bench.watched, bench.settings, task, latency=bench.latency, journals=tmp_path
    )


def test_no_start_serves_twice(task, bench, tmp_path):
    first = planned(bench, task, tmp_path, plan_thresholds)
    later = planned(bench, task, tmp_path, plan_judged)
    judged = next(shard for shard in later if shard.perturbation == "judged")
    probed = [shard for shard in later if shard.perturbation != "judged"]
    assert [shard.probe for shard in probed] == ["lighting@1", "lighting@3", "unseen_object@2"]
    assert len({shard.comparison.starts for shard in probed}) == 1, "severities share their starts"
    compared = [start.to_json() for start in matched_starts(task, root_seed=5, count=5)]
    sets = [first[0].comparison.starts, judged.comparison.starts, probed[0].comparison.starts]
    every = [start for starts in (*sets, compared) for start in starts]
    assert len(every) == len(set(every)) == 2 + 2 + 1 + 5


def test_a_start_does_not_depend_on_how_many_there_are(task):
    few = starts_of(task, "judged", root_seed=9, count=2)
    assert starts_of(task, "judged", root_seed=9, count=5)[:2] == few
    assert starts_of(task, "thresholds", root_seed=9, count=2) != few


def test_hashes_are_of_every_planned_rollout(task, bench):
    found = start_hashes(task, bench.settings, root_seed=5)
    assert len(found) == len(set(found)) == 2 + 2 + 3
    assert found != start_hashes(task, bench.settings, root_seed=6)


@pytest.mark.parametrize("name", ["real_time", "warm_start"])
def test_a_rule_under_which_nothing_can_be_drawn_again_is_refused(task, bench, name):
    rule = JoiningSettings(rule=name)
    with pytest.raises(ConfigError, match=r"monitors is probes.*on what it sees alone"):
        require_runnable(bench.settings, rule, task, root_seed=5)
    require_runnable(bench.settings, JoiningSettings(), task, root_seed=5)
    require_runnable(MonitorsSettings(), rule, task, root_seed=5)


def test_a_probe_that_the_task_does_not_know_is_refused_by_its_place(task, bench):
    probes = {**bench.settings.probes, "fog": ProbeFamily(severities=[1.0])}
    settings = bench.settings.model_copy(update={"probes": probes})
    place = r"params\.yaml: monitors\.probes\.fog is refused by the task"
    with pytest.raises(ConfigError, match=place):
        require_runnable(settings, JoiningSettings(), task, root_seed=5)
