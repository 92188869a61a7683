"""The task's planner stands in the comparison as a policy that draws nothing."""

import numpy as np
import pytest

from genpolicy.candidates import planned as module
from genpolicy.candidates.contenders import in_comparison
from genpolicy.candidates.planned import (
    PlannedPolicy,
    PlannerPolicy,
    planned,
    require_compared,
)
from genpolicy.contract.horizons import HorizonConfig
from genpolicy.contract.planner import PLANNER, planner_sha256
from genpolicy.errors import ConfigError, ContractError, IntegrityError, NonFiniteError
from genpolicy.policies.prefix import Prefix
from genpolicy.tasks.api import WorldSettings, load_task
from genpolicy.tasks.identity import task_identity

TASK = "tabletop_insertion"
HORIZONS = HorizonConfig(
    observation_horizon=2, prediction_horizon=4, execution_horizon=2, action_period_s=0.05
)


def policy(planner):
    return PlannerPolicy(planner, sha256="a" * 64, horizons=HORIZONS, observation_dim=3)


def counting(history, *, horizons):
    """Rows that say how often they were asked would not be the same again; these are."""
    return np.full((horizons.prediction_horizon, 10), history.sum())


def asked(of, observations, candidates=1, **options):
    return of.sample(observations, noise_names=[("n", 0)] * len(observations),
                     candidates=candidates, **options)  # fmt: skip


def test_every_candidate_of_an_observation_is_the_one_chunk_and_each_row_is_planned_alone():
    seen = np.arange(12.0).reshape(2, 2, 3)
    found = asked(policy(counting), seen, candidates=3)
    assert found.actions.shape == (2, 3, 4, 10) and found.nfe == 0
    assert (found.actions[0] == seen[0].sum()).all() and (found.actions[1] == seen[1].sum()).all()
    assert not policy(counting).stochastic and not policy(counting).guided


def test_what_is_no_observation_or_no_chunk_is_refused():
    one = policy(counting)
    for wrong in (np.zeros((1, 3, 3)), np.zeros((1, 2, 4)), np.zeros((0, 2, 3))):
        with pytest.raises(ContractError):
            asked(one, wrong)
    with pytest.raises(NonFiniteError):
        asked(one, np.full((1, 2, 3), np.nan))
    with pytest.raises(ContractError, match="at least one candidate"):
        asked(one, np.zeros((1, 2, 3)), candidates=0)
    with pytest.raises(ConfigError, match=r"stress\.joining\.exempt"):
        asked(one, np.zeros((1, 2, 3)), prefix=Prefix(np.zeros((1, 4, 10)), np.zeros((1, 4)), 5.0))
    with pytest.raises(ContractError, match=r"\(3, 10\), expected \(4, 10\)"):
        asked(policy(lambda *_, **__: np.zeros((3, 10))), np.zeros((1, 2, 3)))


def test_a_planner_cannot_write_into_what_the_others_see():
    def writes(history, *, horizons):
        history[:] = 0.0
        return np.zeros((horizons.prediction_horizon, 10))

    seen = np.ones((1, 2, 3))
    asked(policy(writes), seen)
    assert (seen == 1.0).all()


def test_it_is_known_by_the_task_and_another_task_is_another_planner():
    own = planned(TASK, HORIZONS, seed=0)
    assert own.name == PLANNER and own.sha256 == planner_sha256(task_identity(TASK)["sha256"])
    assert own.load().checkpoint_hash == own.sha256
    with pytest.raises(IntegrityError, match="Run the ladder again"):
        PlannedPolicy(TASK, HORIZONS, "0" * 64, 0).load()


def test_a_task_without_a_planner_has_none(foreign_task):
    with pytest.raises(ConfigError, match="ring_cell offers no planner"):
        planned(foreign_task, HORIZONS, seed=0)
    with pytest.raises(ConfigError, match="ring_cell offers no planner"):
        require_compared(foreign_task, ["bc", PLANNER], rehearsal=True)
    require_compared(foreign_task, ["bc"], rehearsal=False)


def test_where_there_is_one_only_a_rehearsal_may_leave_it_out():
    with pytest.raises(ConfigError, match=f"without {PLANNER}"):
        require_compared(TASK, ["bc"], rehearsal=False)
    require_compared(TASK, ["bc"], rehearsal=True)
    require_compared(TASK, ["bc", PLANNER], rehearsal=False)


def test_it_stands_in_the_comparison_where_it_is_named_and_nowhere_else(tmp_path, monkeypatch):
    def standing(baselines):
        found = in_comparison(
            tmp_path, baselines=baselines, candidates=[], brought=[], seed=3, device="cpu",
            task=TASK, horizons=HORIZONS,
        )  # fmt: skip
        return [(one.name, one.seed) for one in found]

    assert standing([PLANNER]) == [(PLANNER, 3)] and standing([]) == []
    monkeypatch.setattr(module, "planner_of", lambda _: None)
    with pytest.raises(ConfigError, match="offers no planner"):
        standing([PLANNER])


def test_the_planner_of_the_task_answers_what_its_policy_answers():
    task, own = load_task(TASK), planned(TASK, HORIZONS, seed=0).load()
    start = task.sample_start(np.random.default_rng(3))
    world = task.make_world(start, settings=WorldSettings(task.calibration_epochs[-1]))
    seen = np.repeat(world.observe()[None], 2, axis=0)
    drawn = asked(own, seen[None]).actions[0, 0]
    assert np.array_equal(drawn, task.planner(seen, horizons=HORIZONS))
