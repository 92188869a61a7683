"""The checker is given the cell's own figures: each one changed in the cell changes there."""

from dataclasses import replace

import numpy as np

from genpolicy.feasibility.figures import expected_motion


def test_every_figure_is_that_of_the_cell(cell):
    found, limits = expected_motion(cell), cell.usable_limits
    assert found.scene_path == cell.kinematics.scene_path
    assert found.workspace_m.tolist() == [
        list(cell.workspace.lower_m),
        list(cell.workspace.upper_m),
    ]
    own = cell.limits
    assert np.array_equal(
        found.rates, [limits.velocity_rad_s, limits.acceleration_rad_s2, limits.jerk_rad_s3]
    )
    assert np.array_equal(found.arm_rates, [own.velocity_rad_s, own.acceleration_rad_s2])
    assert np.array_equal(found.torque_nm, own.torque_nm)
    assert found.tcp_speed_m_s == cell.settings.tcp_speed_limit_m_s
    assert found.tcp_turn_rad_s == cell.settings.tcp_turn_limit_rad_s
    assert found.held_opening_m == cell.settings.held_opening_m
    assert found.condition == cell.settings.condition_limit
    contact, settings = found.contact, cell.settings
    assert contact.phases == cell.contact_phases
    assert contact.opening_phases == cell.opening_phases
    assert contact.force_n == {"insert": 40.0, "release": 40.0}
    assert contact.stiffness_n_m == 2500.0
    assert contact.speed_m_s == settings.contact_speed_limit_m_s
    assert contact.cone_rad == settings.approach_cone_rad
    assert contact.forgiven_m == settings.step_tolerance_m
    assert contact.release_depth_m == settings.release_depth_m
    projection = found.projection
    assert projection.opening_m == (settings.gripper_lower_m, settings.gripper_upper_m)
    assert projection.beyond_m == settings.gripper_tolerance_m
    assert projection.moved_m == settings.position_change_limit_m
    assert projection.turned_rad == settings.rotation_change_limit_rad


def test_a_stricter_cell_gives_stricter_figures(cell):
    settings = cell.settings.model_copy(update={"velocity_factor": 0.5, "tcp_speed_limit_m_s": 0.1})
    found = expected_motion(replace(cell, settings=settings))
    assert np.allclose(found.rates[0], 0.5 * cell.limits.velocity_rad_s)
    assert found.tcp_speed_m_s == 0.1


def test_what_observations_show_is_asked_of_whoever_calls(cell):
    assert expected_motion(cell).seen is None
    assert expected_motion(cell, np.negative).seen is np.negative
