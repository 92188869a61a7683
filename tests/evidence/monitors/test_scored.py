"""Scores: of what was drawn, drawn again; another chunk is refused."""

from dataclasses import replace

import pytest

from genpolicy.errors import IntegrityError, NonFiniteError
from genpolicy.evidence.monitors.plan import plan_thresholds
from genpolicy.evidence.monitors.scored import score_method, scorings
from genpolicy.evidence.stress.matched import run_shard
from genpolicy.monitors.registry import MONITORS
from genpolicy.policies.policy import NetworkPolicy


@pytest.fixture(scope="module")
def scoring(bench, task, tmp_path_factory):
    journals = tmp_path_factory.mktemp("journals")
    (shard,) = plan_thresholds(
        bench.comparison, bench.watched, bench.settings, task,
        latency=bench.latency, journals=journals,
    )  # fmt: skip
    run_shard(shard)
    (found,) = scorings([shard], bench.settings, artifacts=bench.artifacts, other_seeds=[])
    return replace(found, monitors=("support", "time_in_episode"))


def test_rows_are_in_the_order_of_the_rollouts(scoring):
    rows = score_method(scoring).scores
    clock = [row for row in rows if row.monitor == "time_in_episode"]
    assert [row.invocation for row in clock if row.start == 0] == list(
        range(sum(row.start == 0 for row in clock))
    )
    assert all(row.score == row.time_s for row in clock)
    assert {row.phase for row in rows} == {"approach"}


def test_another_chunk_than_was_drawn_is_refused(scoring, monkeypatch):
    drawn = NetworkPolicy.sample

    def moved(policy, observations, **others):
        found = drawn(policy, observations, **others)
        return replace(found, actions=found.actions + 1e-6)

    monkeypatch.setattr(NetworkPolicy, "sample", moved)
    with pytest.raises(IntegrityError, match="another chunk than was drawn by invocation 0"):
        score_method(scoring)


def test_a_score_that_is_none_is_refused(scoring, monkeypatch):
    class Broken:
        def score(self, invocation):
            return float("nan")

    monkeypatch.setitem(MONITORS, "support", lambda fit: Broken())
    with pytest.raises(NonFiniteError, match="the score of support"):
        score_method(scoring)
