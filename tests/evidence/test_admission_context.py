"""What feasibility is told of a moment: seam, scene, freshness."""

import numpy as np
import pytest

from genpolicy.evidence.admission_context import (
    context_at_rest,
    make_checker,
    recorded_proposal,
    seam,
)
from genpolicy.feasibility.checks import CHECKS, without
from genpolicy.tasks.api import WorldSettings


@pytest.fixture(scope="module")
def world(task, plans, kit):
    return task.make_world(plans.starts[0], settings=WorldSettings(kit.EPOCH))


def test_the_seam_continues_the_commands(checker, plans, world):
    commands = list(plans.actions[0][:3])
    q_cmd, before = seam(checker, commands, world.q_meas)
    assert q_cmd.shape == (7,) and before.shape == (2, 7)
    position, _ = checker.kinematics.forward(np.concatenate([before, q_cmd[None]]))
    np.testing.assert_allclose(position, np.stack(commands)[:, :3], atol=1e-6)
    # At 0.3 m/s a joint of this arm moves less than a tenth of a radian per action.
    assert np.abs(np.diff(np.concatenate([before, q_cmd[None]]), axis=0)).max() < 0.1


def test_a_recorded_chunk_at_rest_is_fresh_and_admissible(task, checker, plans, world, kit):
    observation = world.observe()
    context = context_at_rest(
        task, checker, observation,
        maximum_age_s=kit.EXECUTION.maximum_age_s, execution_horizon=8,
    )  # fmt: skip
    chunk = recorded_proposal(
        task, plans.actions[0][:16], observation, action_period_s=0.05, chunk_id="a"
    )
    assert context.rows(16) == slice(0, 8)
    assert context.phase == chunk.metadata.task_phase == "approach"
    np.testing.assert_allclose(context.last_action[:3], observation[:3])
    result = checker.admit(chunk, context=context)
    assert result.verdict.passed, result.verdict.first_reason


def test_a_phase_without_an_age_is_an_error(task, checker, world):
    with pytest.raises(KeyError, match="approach"):
        context_at_rest(task, checker, world.observe(), maximum_age_s={}, execution_horizon=None)


def test_a_checker_has_all_checks_unless_it_is_given_fewer(task, kit):
    period_s = kit.HORIZONS.action_period_s
    whole = make_checker(task, kit.FEASIBILITY, action_period_s=period_s)
    assert whole.checks == CHECKS and whole.cell.action_period_s == period_s
    less = make_checker(task, kit.FEASIBILITY, action_period_s=period_s, checks=without("expired"))
    assert less.checks == without("expired")
