"""A cell that would check too little is refused, and so is a state that is of another cell."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from genpolicy.errors import ConfigError, ContractError
from genpolicy.feasibility.cell import cell_of
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.robot.limits import FR3
from genpolicy.tasks.api import load_task


def test_it_takes_from_the_task_what_the_task_decides(kit):
    task = load_task("tabletop_insertion")
    cell = cell_of(task, FeasibilitySettings(), action_period_s=0.05)
    assert cell.phases == task.phases
    assert (cell.contact_phases, cell.opening_phases) == (task.contact_phases, task.opening_phases)
    assert cell.limits is task.limits and cell.workspace is task.workspace
    assert cell.joint_count == len(task.posture_rad)


@pytest.mark.parametrize("name", ["contact_phases", "opening_phases"])
def test_a_phase_that_the_task_does_not_know_is_a_configuration_error(cell, name):
    with pytest.raises(ConfigError, match=rf"{name} is naming \['inserting'\]"):
        replace(cell, **{name: frozenset({"insert", "inserting"})})


def test_a_robot_that_is_not_held_against_itself_is_a_configuration_error(cell):
    blind = SimpleNamespace(self_pair_count=0)
    with pytest.raises(ConfigError, match="without any pair"):
        replace(cell, collision=blind)


def test_limits_of_another_robot_are_a_configuration_error(cell):
    with pytest.raises(ConfigError, match="position limits of the table"):
        replace(cell, limits=FR3)


@pytest.mark.parametrize("period_s", [0.0, -0.05, float("nan"), float("inf")])
def test_a_period_that_is_none_is_a_configuration_error(cell, period_s):
    with pytest.raises(ConfigError, match="action_period_s"):
        replace(cell, action_period_s=period_s)


def test_usable_limits_are_the_makers_times_the_factors(cell):
    settings = FeasibilitySettings(velocity_factor=0.1, acceleration_factor=0.2, jerk_factor=0.3)
    usable = replace(cell, settings=settings).usable_limits
    np.testing.assert_allclose(usable.velocity_rad_s, 0.1 * cell.limits.velocity_rad_s)
    np.testing.assert_allclose(usable.acceleration_rad_s2, 0.2 * cell.limits.acceleration_rad_s2)
    np.testing.assert_allclose(usable.jerk_rad_s3, 0.3 * cell.limits.jerk_rad_s3)
    assert cell.usable_limits is cell.usable_limits


def test_an_unknown_phase_is_no_matter_for_a_margin(checker, kit):
    """It would be no contact phase, and the chunk would be held against too few limits."""
    good = kit.line(kit.START, kit.SIDE)
    ctx = replace(kit.context(checker, kit.START), phase="inserting")
    for refused in (
        lambda: kit.judge(checker, good, ctx, task_phase="inserting"),
        lambda: checker.admit(kit.proposal(good, task_phase="inserting"), context=ctx),
    ):
        with pytest.raises(ContractError, match="'inserting', expected a phase of the task"):
            refused()


def test_the_state_of_another_arm_is_refused(checker, kit):
    ctx = kit.context(checker, kit.START)
    six = replace(ctx, q_cmd=ctx.q_cmd[:6], q_meas=ctx.q_meas[:6], q_cmd_history=np.zeros((0, 0)))
    assert six.q_cmd_history.shape == (0, 6)
    with pytest.raises(ContractError, match="of 6 joints, expected 7"):
        kit.judge(checker, kit.line(kit.START, kit.SIDE), six)


def test_the_force_envelope_is_of_contact_phases_and_below_what_the_supervisor_stops_at(cell):
    settings = FeasibilitySettings(contact_force_by_phase_n={"insert": 55.0})
    other = replace(cell, settings=settings)
    assert other.force_envelope_n == {"insert": 55.0, "release": 40.0}
    other.require_within({"insert": 55.0, "release": 40.0, "approach": 1.0})
    with pytest.raises(ConfigError, match=r"phase insert is 55 N, expected at most 54.9 N"):
        other.require_within({"insert": 54.9, "release": 80.0})
    with pytest.raises(ConfigError, match=r"phase release is 40 N, expected at most 0 N"):
        other.require_within({"insert": 80.0})
    with pytest.raises(ConfigError, match=r"naming \['approach'\], expected contact phases"):
        replace(cell, settings=FeasibilitySettings(contact_force_by_phase_n={"approach": 5.0}))
