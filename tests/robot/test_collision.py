"""Collisions of whole arms: where shapes stand, what is swept, and what may touch."""

import mujoco
import numpy as np
import pytest
from near import paths_of, solve

from genpolicy.robot.scene_state import SceneState


def near_configurations(arm, rng, n):
    """Configurations with the tool down, over and in the scene."""
    lower, upper = [0.38, -0.2, 0.05], [0.66, 0.2, 0.25]
    return solve(arm, rng.uniform(lower, upper, (n, 3)))


def test_placements_equal_mujoco(arm, model, rng, scene_path):
    mj = mujoco.MjModel.from_xml_path(str(scene_path))
    data = mujoco.MjData(mj)
    for _ in range(20):
        q = rng.uniform(arm.lower_rad, arm.upper_rad)
        data.qpos[:7], data.qpos[7:9] = q, 0.02
        mujoco.mj_kinematics(mj, data)
        placed = zip(model.shapes.robot, model.placements(q, opening_m=0.02), strict=True)
        for shape, (rotation, position) in placed:
            if shape.name != "held":
                geom = mj.geom(shape.name).id
                assert np.abs(data.geom_xpos[geom] - position).max() < 1e-9
                assert np.abs(data.geom_xmat[geom].reshape(3, 3) - rotation).max() < 1e-9


def test_the_held_object_hangs_where_the_weld_says(arm, model):
    # relpose of the weld: 0.1184 m along the hand; TCP at 0.1034 m: 15 mm beyond, tip 40 mm on.
    q = solve(arm, [[0.5, 0.0, 0.2]])[0]
    shape = [s.name for s in model.shapes.robot].index("held")
    _, position = model.placements(q, opening_m=0.0)[shape]
    assert np.allclose(position, [0.5, 0.0, 0.185], atol=1e-6)
    assert model.shapes.held_reach_m == pytest.approx(0.055)


def test_inflating_or_adding_never_removes_a_collision(arm, model, rng, random_scene):
    """P10: clearance inflates the robot; a second body only adds."""
    q = near_configurations(arm, rng, 150)
    away = ((0.5, 5.0, 0.11), (1.0, 0, 0, 0))
    for row in q:
        scene = random_scene(rng)
        fewer = SceneState({"post": away, "fixture": scene.bodies["fixture"]})
        hit = [model.in_collision(row, scene, clearance_m=c) is not None for c in (0, 0.003, 0.01)]
        assert hit == sorted(hit)
        if model.in_collision(row, fewer) is not None:
            assert hit[0]


def test_swept_is_conservative_against_dense_sampling(arm, model, rng, random_scene):
    """P11: whenever 200 samples of a motion hit, the swept test says hit."""
    start = near_configurations(arm, rng, 120)
    end = start + rng.normal(0, 0.06, start.shape)
    dense_hits = swept_hits = false_alarms = 0
    for a, b in zip(start, end, strict=True):
        scene = random_scene(rng)
        swept = model.check_swept(paths_of(np.stack([a, b])[None], scene)).hits[0] is not None
        steps = np.linspace(0, 1, 200)[:, None]
        dense_path = (a + steps * (b - a))[None]
        dense = model.check_samples(
            paths_of(np.concatenate([dense_path[:, :1], dense_path], axis=1), scene)
        )
        hit = dense.hits[0] is not None
        assert swept or not hit
        dense_hits += hit
        swept_hits += swept
        false_alarms += swept and not hit
    assert dense_hits >= 20
    assert false_alarms <= max(3, 0.05 * swept_hits)


def test_a_thin_wall_between_two_samples_is_found(arm, model):
    """Fault 31: the post stands between two actions 20 cm apart."""
    q = solve(arm, [[0.5, -0.15, 0.15], [0.5, 0.15, 0.15]])
    scene = SceneState()
    assert model.check_samples(paths_of(q[None], scene)).hits[0] is None
    assert model.in_collision(q[0], scene) is None
    hit = model.check_swept(paths_of(q[None], scene)).hits[0]
    assert hit is not None
    assert hit.second == "post"


def test_contact_with_the_target_only_where_allowed(arm, model):
    low = solve(arm, [[0.65, 0.0, 0.13], [0.656, 0.0, 0.10]])  # tip inside the wall
    assert model.check_samples(paths_of(low[None], SceneState())).hits[0].first == "held"
    allowed = paths_of(low[None], SceneState(), allowed=True)
    assert model.check_samples(allowed).hits[0] is None
    empty = paths_of(low[None], SceneState(), held=False)
    assert model.check_samples(empty).hits[0] is None


def test_open_fingers_collide_where_closed_ones_do_not(arm, model):
    """The hand stands over the wall of the target; only the open finger reaches beside it."""
    q = solve(arm, [[0.65, 0.07, 0.04]])[0]
    found = [model.in_collision(q, SceneState(), held=False, opening_m=w) for w in (0.0, 0.04)]
    assert found[0] is None
    assert found[1].first.startswith("finger")
    assert found[1].second.startswith("fixture")


def test_self_collision_is_found(arm, model, rng):
    q = rng.uniform(arm.lower_rad, arm.upper_rad, (4000, 7))
    names = {shape.name for shape in model.shapes.robot}
    report = model.check_samples(paths_of(np.stack([q, q], axis=1), SceneState()))
    own = [h for h in report.hits if h is not None and h.second in names]
    assert own
    tool = {"hand", "finger_left", "finger_right", "held"}
    assert {h.first in tool for h in own} == {True, False}  # a link may hit another, too
