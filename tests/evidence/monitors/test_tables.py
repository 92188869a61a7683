"""The stage's work on real rollouts: order, tables, journals, and what is not touched."""

import pytest
from _probed import write_probed

from genpolicy.evidence.documents.shadow import CHECKER
from genpolicy.evidence.monitors import tables as module
from genpolicy.evidence.monitors.alarms import threshold_rows
from genpolicy.evidence.monitors.plan import plan_judged
from genpolicy.evidence.monitors.scored import Scored
from genpolicy.evidence.monitors.tables import write_unwatched
from genpolicy.evidence.rows.monitors import (
    MonitorAlarmRow,
    MonitorScoreRow,
    MonitorThresholdRow,
    MonitorUnavailableRow,
)
from genpolicy.evidence.rows.stress import RolloutRow
from genpolicy.evidence.stress.matched import run_shard
from genpolicy.integrity.rows import read_rows
from genpolicy.verification.rollouts import derived_with_recoveries, differences


@pytest.fixture(scope="module")
def written(tmp_path_factory, bench, task):
    folder = tmp_path_factory.mktemp("monitors")
    write_probed(folder, bench, task)
    return folder


def test_every_invocation_is_scored_by_everybody_who_can(written):
    rollouts = read_rows(written / "rollouts.parquet", RolloutRow)
    assert len(rollouts) == 2 + 2 + 3
    scores = read_rows(written / "scores.parquet", MonitorScoreRow)
    begun = sum(row.invocations for row in rollouts)
    names = {row.monitor for row in scores}
    assert names == {"support", "own_loss", "time_in_episode", "sample_variance"}
    assert len(scores) == begun * len(names)
    (absent,) = read_rows(written / "unavailable.parquet", MonitorUnavailableRow)
    assert (absent.monitor, "one seed" in absent.why) == ("seed_disagreement", True)


def test_a_monitor_sees_a_probe_and_not_what_it_does_not_change(written):
    """The first observation under noise is further out; a wider peg is seen nowhere before it."""
    scores = {
        (row.condition, row.invocation): row.score
        for row in read_rows(written / "scores.parquet", MonitorScoreRow)
        if row.monitor == "support" and row.start == 0
    }
    assert scores["lighting@3", 0] != scores["lighting@1", 0] != scores["unseen_object@2", 0]
    assert scores["lighting@3", 0] > scores["unseen_object@2", 0]


def test_no_success_no_threshold_no_alarm(written):
    assert not any(row.success for row in read_rows(written / "rollouts.parquet", RolloutRow))
    above = read_rows(written / "thresholds.parquet", MonitorThresholdRow)
    assert all(row.threshold is None and row.episodes == 0 for row in above)
    alarms = read_rows(written / "alarms.parquet", MonitorAlarmRow)
    assert not any(row.alarm for row in alarms)
    assert {row.family for row in alarms} == {"nominal", "lighting", "unseen_object"}


def test_rows_are_what_journals_say_and_the_checker_finds_nothing(written):
    rows = {
        (row.perturbation, row.start): vars(row)
        for row in read_rows(written / "rollouts.parquet", RolloutRow)
    }
    for path in sorted((written / "journals").glob("*.mcap")):
        for derived in derived_with_recoveries(path)[0].values():
            row = rows.pop((derived["perturbation"], derived["start"]))
            assert differences(row, derived) == []
    assert not rows
    assert CHECKER.read(written).violations == []


def test_journals_are_the_same_bytes_with_and_without_monitors(written, bench, task, tmp_path):
    """Who scores comes after the rollout: nothing in a journal can hang on it."""
    shards = plan_judged(
        bench.comparison, bench.watched, bench.settings, task,
        latency=bench.latency, journals=tmp_path,
    )  # fmt: skip
    for shard in shards:
        run_shard(shard)
        name = shard.journal.name
        assert shard.journal.read_bytes() == (written / "journals" / name).read_bytes()


def test_the_same_bytes_every_time(written, bench, task, tmp_path):
    write_probed(tmp_path, bench, task)
    for path in sorted(written.rglob("*")):
        if path.is_file():
            assert path.read_bytes() == (tmp_path / path.relative_to(written)).read_bytes(), path


@pytest.mark.parametrize("fails_at", ["thresholds", "judged"])
def test_a_monitor_that_fails_once_alarms_nowhere_and_says_why(
    written, bench, task, tmp_path, monkeypatch, fails_at
):
    """Without thresholds it would pass for one that is silent; the others are as without it."""
    score = module.score_method

    def failing(scoring):
        found = score(scoring)
        if "own_loss" not in scoring.monitors or fails_at not in {
            row.condition for row in found.scores
        }:
            return found
        left = [row for row in found.scores if row.monitor != "own_loss"]
        why = MonitorUnavailableRow("flow", "own_loss", "it failed")
        return Scored(left, [*found.unavailable, why])

    monkeypatch.setattr(module, "score_method", failing)
    write_probed(tmp_path, bench, task)
    absent = read_rows(tmp_path / "unavailable.parquet", MonitorUnavailableRow)
    assert sorted(row.monitor for row in absent) == ["own_loss", "seed_disagreement"]
    alarms = read_rows(tmp_path / "alarms.parquet", MonitorAlarmRow)
    before = read_rows(written / "alarms.parquet", MonitorAlarmRow)
    assert alarms == [row for row in before if row.monitor != "own_loss"]
    scores = read_rows(tmp_path / "scores.parquet", MonitorScoreRow)
    again = threshold_rows(
        scores, read_rows(tmp_path / "rollouts.parquet", RolloutRow),
        alpha=bench.settings.alpha, phases=task.phases,
    )  # fmt: skip
    assert again == read_rows(tmp_path / "thresholds.parquet", MonitorThresholdRow)


def test_nothing_asked_writes_tables_without_rows(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "map_shards", None)
    write_unwatched(tmp_path)
    assert read_rows(tmp_path / "alarms.parquet", MonitorAlarmRow) == []
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "alarms.parquet", "rollouts.parquet", "scores.parquet", "thresholds.parquet",
        "unavailable.parquet",
    ]  # fmt: skip
