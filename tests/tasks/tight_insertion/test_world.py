"""The tight cell: half a millimetre of play, a grasp that is off, and contact that is felt."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from genpolicy.contract.action import GRIPPER
from genpolicy.tasks.api import WorldSettings
from genpolicy.tasks.tabletop_insertion import scene
from genpolicy.tasks.tabletop_insertion.observation import OBSERVATION
from genpolicy.tasks.tabletop_insertion.plans import travel
from genpolicy.tasks.tight_insertion.start import sample_start
from genpolicy.tasks.tight_insertion.world import (
    CAMERA_NOISE_M,
    HOLE_HALF_WIDTH_M,
    SCENE_PATH,
    TightWorld,
)

SETTINGS = WorldSettings("epoch_1")
STRAIGHT = dict.fromkeys(("grip_x_m", "grip_y_m", "tilt_x_rad", "tilt_y_rad"), 0.0)
LEVEL = dict.fromkeys(("yaw_rad", "hole_yaw_rad", "post_y_m"), 0.0)
TRUE = replace(sample_start(np.random.default_rng(4)), **STRAIGHT, **LEVEL)
"""A start whose peg sits straight in the middle of the grasp, and whose hole is not turned."""
PLAY_M, BEVEL_M = 0.0005, 0.001


def pushed_down(aside_m):
    """A world whose peg goes down that far beside the hole's middle, and the force it took, N."""
    world = TightWorld(TRUE, settings=SETTINGS)
    over = np.array([TRUE.hole_x_m + aside_m, TRUE.hole_y_m])
    high, low = scene.FIXTURE_TOP_M + scene.TIP_OFFSET_M + 0.02, scene.FIXTURE_TOP_M + 0.03
    force_n, collided = 0.0, False
    around = ([0.38, 0.15, 0.15], [TRUE.hole_x_m, 0.15, 0.15])
    for target in (*around, [*over, high], [*over, low]):
        action = world.last_action
        for position in travel(
            np.array([action[:3], target]), speed_m_s=0.06, acceleration_m_s2=0.6
        ):
            action[:3], action[GRIPPER] = position, 0.01
            world.command(action)
            world.advance()
            force_n = max(force_n, world.contact_force_n)
            collided = collided or world.collision
    assert not collided
    return world, force_n


def geometry(path):
    """What a model is made of but for the scene: kinematics, masses and shapes of arm and peg."""
    model = mujoco.MjModel.from_xml_path(str(path))
    ours = np.flatnonzero(model.geom_group != 3)
    bodies = [model.body(number).name for number in range(model.nbody)]
    of_scene = {"world", "post", "fixture"}
    kept = [number for number, name in enumerate(bodies) if name not in of_scene]
    return {
        "bodies": [bodies[number] for number in kept],
        "masses": model.body_mass[kept].tolist(),
        "frames": np.hstack([model.body_pos, model.body_quat])[kept].tolist(),
        "geoms": np.hstack([model.geom_size, model.geom_pos, model.geom_quat])[ours].tolist(),
        "joints": np.column_stack([model.jnt_range, model.jnt_axis]).tolist(),
        "welds": model.eq_data.tolist(),
        "motors": model.actuator_ctrlrange.tolist(),
        "option": [model.opt.timestep, model.opt.impratio, int(model.opt.cone)],
        "contact": np.hstack([model.geom_friction, model.geom_solref])[ours].tolist(),
    }


def test_arm_hand_and_peg_are_those_of_the_tabletop():
    assert geometry(SCENE_PATH) == geometry(scene.SCENE_PATH)


def test_the_hole_leaves_half_a_millimetre_on_each_side():
    model = scene.load_model(path=SCENE_PATH)
    peg = model.geom("peg").size[:2]
    for name, axis, sign in (("front", 0, 1), ("back", 0, -1), ("left", 1, 1), ("right", 1, -1)):
        wall = model.geom(f"fixture_{name}")
        inner = sign * wall.pos[axis] - wall.size[axis]
        assert inner == pytest.approx(HOLE_HALF_WIDTH_M)
        assert inner - peg[axis] == pytest.approx(PLAY_M)
        rim = model.geom(f"fixture_rim_{name}")
        assert sign * rim.pos[axis] - rim.size[axis] - inner == pytest.approx(BEVEL_M)


@pytest.mark.parametrize(("aside_m", "enters", "touches"), [
    (0.0, True, False), (0.0008, True, True), (-0.0013, True, True), (0.0030, False, True),
    (-0.0030, False, True),
])  # fmt: skip
def test_a_peg_beside_the_play_is_felt_and_beyond_the_chamfer_stands_on_the_rim(
    aside_m, enters, touches
):
    world, force_n = pushed_down(aside_m)
    assert (world.tip_depth_m > 0.015) is enters
    assert (force_n > 5.0) is touches


def test_where_the_peg_sits_in_the_grasp_moves_the_peg_and_nothing_that_is_observed():
    off = replace(TRUE, grip_x_m=0.0015, grip_y_m=-0.001, tilt_y_rad=0.012)
    straight, leaning = (TightWorld(start, settings=SETTINGS) for start in (TRUE, off))
    turn = straight.tcp_pose[1]
    moved = leaning.data.body("peg").xpos - straight.data.body("peg").xpos
    assert turn.T @ moved == pytest.approx([0.0015, -0.001, 0.0], abs=2e-4)
    axis = [world.data.body("peg").xmat.reshape(3, 3)[:, 2] for world in (straight, leaning)]
    assert np.arccos(axis[0] @ axis[1]) == pytest.approx(0.012, abs=1e-3)
    assert leaning.observe() == pytest.approx(straight.observe(), abs=1e-4)


def test_the_width_of_the_post_is_that_of_the_start_and_never_wider_than_who_checks_believes():
    believed = scene.load_model(path=SCENE_PATH).geom("post").size[0]
    for seed in range(50):
        start = sample_start(np.random.default_rng(seed))
        assert start.post_radius_m <= believed
    world = TightWorld(replace(TRUE, post_radius_m=0.021), settings=SETTINGS)
    assert world.model.geom("post").size[0] == 0.021
    assert scene.load_model(path=SCENE_PATH).geom("post").size[0] == believed


def test_equal_starts_give_equal_states_and_views_and_another_grip_does_not():
    first, again = (TightWorld(TRUE, settings=SETTINGS) for _ in range(2))
    assert first.state_sha256() == again.state_sha256()
    assert first.observe().tolist() == again.observe().tolist()
    other = TightWorld(replace(TRUE, grip_x_m=0.001), settings=SETTINGS)
    assert other.state_sha256() != first.state_sha256()


def test_the_camera_is_as_noisy_as_it_says_and_each_rollout_in_its_own_way():
    seen = []
    for seed in range(400):
        world = TightWorld(TRUE, settings=WorldSettings("epoch_1", seed=seed))
        seen.append(world.observe()[OBSERVATION.slices["hole_pose"]][:2])
    assert np.std(seen, axis=0) == pytest.approx([CAMERA_NOISE_M] * 2, rel=0.15)


def test_a_wider_peg_takes_as_much_of_the_play_as_on_the_tabletop():
    wide = TightWorld(TRUE, settings=WorldSettings("epoch_1", probe="unseen_object"))
    half = wide.model.geom("peg").size[0]
    assert 0.01 < half < HOLE_HALF_WIDTH_M
    left = (HOLE_HALF_WIDTH_M - half) / PLAY_M
    assert left == pytest.approx((scene.HOLE_HALF_WIDTH_M - 0.0115) / 0.004)
