"""Scores: of what was drawn, drawn again; another chunk is refused."""

from contextlib import nullcontext
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from genpolicy.errors import IntegrityError, NonFiniteError
from genpolicy.evidence.monitors import scored as module
from genpolicy.evidence.monitors.plan import plan_thresholds
from genpolicy.evidence.monitors.scored import score_method, scorings
from genpolicy.evidence.stress.matched import run_shard
from genpolicy.monitors.names import CONTROLS, TIME, VARIANCE
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


class Broken:
    """Scores until 0.3 s have passed."""

    def __init__(self, fails):
        self.fails = fails

    def score(self, invocation):
        return self.fails() if invocation.time_s > 0.3 else 1.0


def raises(error):
    raise error


FAILURES = {
    "infinite": (lambda fit: Broken(lambda: float("inf")), "its score was inf"),
    "none": (lambda fit: Broken(lambda: float("nan")), "its score was nan"),
    "chunks of another seed": (lambda fit: Broken(lambda: raises(NO_NUMBERS)), "it failed: chunks"),
    "fit": (lambda fit: raises(np.linalg.LinAlgError("singular")), "its fit failed: singular"),
}
NO_NUMBERS = NonFiniteError(where="chunks", found="NaN", expected="numbers", action="Look.")


@pytest.mark.parametrize("name", FAILURES)
def test_a_monitor_that_fails_is_unavailable_and_the_others_go_on(scoring, monkeypatch, name):
    fitted, why = FAILURES[name]
    monkeypatch.setitem(MONITORS, "support", fitted)
    found = score_method(scoring)
    assert {row.monitor for row in found.scores} == {"time_in_episode"}
    (absent,) = found.unavailable
    assert (absent.monitor, why in absent.why) == ("support", True)
    assert name == "fit" or "thresholds, start 0, invocation" in absent.why


def test_other_bytes_are_no_failure_of_a_monitor(scoring, monkeypatch):
    error = IntegrityError(where="x", found="y", expected="z", action="Look.")
    monkeypatch.setitem(MONITORS, "support", lambda fit: Broken(lambda: raises(error)))
    with pytest.raises(IntegrityError):
        score_method(scoring)


def test_of_who_was_brought_and_draws_otherwise_only_what_it_saw_is_scored(scoring, monkeypatch):
    """Whose process it is cannot be asked for the same bytes; what reads draws says so."""
    drawn = NetworkPolicy.sample
    ours = scoring.judged
    brought = SimpleNamespace(name=ours.name)
    monkeypatch.setattr(module, "opened", lambda *_, **__: nullcontext(ours.load()))
    monitors = ("support", "own_loss", "chunk_consistency", *CONTROLS)
    asked = replace(scoring, judged=brought, monitors=monitors)
    assert score_method(asked).unavailable == []

    def moved(policy, observations, **others):
        found = drawn(policy, observations, **others)
        return replace(found, actions=found.actions + 1e-6)

    monkeypatch.setattr(NetworkPolicy, "sample", moved)
    found = score_method(asked)
    assert {row.monitor for row in found.scores} == {"support", TIME}
    assert {row.monitor for row in found.unavailable} == {
        "own_loss", "chunk_consistency", VARIANCE,
    }  # fmt: skip
    assert all("does not draw the same again" in row.why for row in found.unavailable)


def test_one_candidate_has_no_spread(scoring):
    found = score_method(replace(scoring, samples=1, monitors=CONTROLS))
    assert [row.monitor for row in found.unavailable] == [VARIANCE]
