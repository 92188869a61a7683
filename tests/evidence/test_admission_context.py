"""What feasibility is told of a moment: boundary, scene, freshness."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from genpolicy.evidence.admission_context import (
    commands_in_joints,
    context_at_rest,
    make_checker,
    recorded_proposal,
)
from genpolicy.execution.checks import without
from genpolicy.feasibility.checks import CHECKS
from genpolicy.tasks.api import WorldSettings
from genpolicy.tasks.tabletop_insertion.episodes import demonstrate


@pytest.fixture(scope="module")
def plan(task):
    """One demonstration without incident: where it starts and what the operator commanded."""
    spec = task.episode_specs(5, 1, shares={"nominal": 1.0})[0]
    return SimpleNamespace(start=spec.start, actions=demonstrate(spec).actions)


@pytest.fixture(scope="module")
def world(task, plan):
    return task.make_world(plan.start, settings=WorldSettings("epoch_1"))


def test_the_boundary_continues_the_commands(checker, plan, world):
    commands = list(plan.actions[:3])
    q_cmd, before = commands_in_joints(checker, commands, world.q_meas)
    assert q_cmd.shape == (7,) and before.shape == (2, 7)
    position, _ = checker.kinematics.forward(np.concatenate([before, q_cmd[None]]))
    np.testing.assert_allclose(position, np.stack(commands)[:, :3], atol=1e-6)
    # At 0.3 m/s a joint of this arm moves less than a tenth of a radian per action.
    assert np.abs(np.diff(np.concatenate([before, q_cmd[None]]), axis=0)).max() < 0.1


def test_a_recorded_chunk_at_rest_is_fresh_and_admissible(task, checker, plan, world, kit):
    observation = world.observe()
    context = context_at_rest(task, checker, observation)
    chunk = recorded_proposal(
        task, plan.actions[:16], observation, action_period_s=0.05, chunk_id="a"
    )
    assert context.rows(16) == slice(0, 16)
    assert context.phase == chunk.metadata.task_phase == "approach"
    np.testing.assert_allclose(context.last_action[:3], observation[:3])
    result = checker.admit(chunk, context=context)
    assert result.verdict.passed, result.verdict.first_reason


def test_a_recorded_chunk_has_age_zero_and_may_not_be_older(task, checker, plan, world):
    context = context_at_rest(task, checker, world.observe())
    assert context.maximum_age_s == 0.0 and context.now_s == 0.0
    chunk = recorded_proposal(
        task, plan.actions[:16], world.observe(), action_period_s=0.05, chunk_id="a"
    )
    late = checker.admit(chunk, context=replace(context, now_s=0.01))
    assert late.verdict.margins["stale_observation"] < 0


def test_a_checker_has_all_checks_unless_it_is_given_fewer(task, kit):
    period_s = kit.HORIZONS.action_period_s
    whole = make_checker(task, kit.FEASIBILITY, action_period_s=period_s)
    assert whole.checks == CHECKS and whole.cell.action_period_s == period_s
    less = make_checker(
        task, kit.FEASIBILITY, action_period_s=period_s, checks=without(CHECKS, "expired")
    )
    assert less.checks == without(CHECKS, "expired")
