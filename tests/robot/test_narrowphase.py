"""Distances of two shapes: against another library, NaN and improper rotations refused."""

import coal
import fcl
import numpy as np
import pytest
from near import HOME, paths_of, solve

from genpolicy.errors import ContractError, NonFiniteError
from genpolicy.robot.collision import CollisionModel
from genpolicy.robot.narrowphase import penetration, place
from genpolicy.robot.scene_state import SceneState


def coal_geometry(shape, inflation=0.0):
    x, _, z = shape.half_size_m
    if shape.kind == "box":
        return coal.Box(*(2 * (shape.half_size_m + inflation)))
    if shape.kind == "cylinder":
        return coal.Cylinder(x + inflation, 2 * (z + inflation))
    return coal.Capsule(x + inflation, 2 * z)


def coal_distance(shape, placement, other, other_placement):
    result = coal.DistanceResult()
    return coal.distance(
        coal_geometry(shape), coal.Transform3s(*placement),
        coal_geometry(other), coal.Transform3s(*other_placement),
        coal.DistanceRequest(), result,
    )  # fmt: skip


def near_configurations(arm, rng, n):
    """Configurations with the tool down, over and in the scene."""
    lower, upper = [0.38, -0.2, 0.05], [0.66, 0.2, 0.25]
    return solve(arm, rng.uniform(lower, upper, (n, 3)))


def test_fcl_agrees_with_coal_outside_a_millimetre(arm, model, rng, random_scene):
    """P10: verdicts of >= 2000 random scene poses; coal's signed distance is the oracle."""
    q = near_configurations(arm, rng, 2100)
    disagreements = checked = hits = 0
    columns = model.broad.columns
    for i in range(len(q)):
        scene = random_scene(rng)
        found = model.in_collision(q[i], scene) is not None
        robot, surroundings = model.placements(q[i], opening_m=0.01), model.scene_placements(scene)
        nearest = np.inf
        for shape, body, other in zip(columns.shape, columns.body, columns.other, strict=True):
            ours = model.shapes.robot[shape]
            if body >= 0:
                others = [
                    (s, surroundings[j]) for j, s in enumerate(model.shapes.scene)
                    if s.body == model.bodies[body]
                ]  # fmt: skip
            else:
                others = [(model.shapes.robot[other], robot[other])]
            if ours.name not in ("held", "hand", "finger_left", "finger_right", "link7", "link6"):
                continue
            for theirs, placement in others:
                gap = np.linalg.norm(robot[shape][1] - placement[1])
                if gap < nearest + np.linalg.norm(ours.half_size_m) + 2 * np.linalg.norm(
                    theirs.half_size_m
                ):
                    nearest = min(nearest, coal_distance(ours, robot[shape], theirs, placement))
        if abs(nearest) > 1e-3:
            checked += 1
            hits += found
            disagreements += found != (nearest < 0)
    assert disagreements == 0
    assert checked >= 2000
    assert 0.1 < hits / checked < 0.9


def test_fcl_calls_nan_free_and_so_it_never_sees_one(arm, model):
    box = fcl.CollisionObject(fcl.Box(1, 1, 1))
    other = fcl.CollisionObject(fcl.Box(1, 1, 1))
    assert penetration(box, other) is not None
    other.setTransform(fcl.Transform(np.eye(3), np.full(3, np.nan)))
    assert penetration(box, other) is None  # the fault of the library that we guard against
    with pytest.raises(NonFiniteError, match="NaN"):
        place(box, np.eye(3), np.array([np.nan, 0, 0]))
    q = np.tile(HOME, (1, 2, 1))
    q[0, 1, 3] = np.nan
    for query in (model.check_samples, model.check_swept):
        with pytest.raises(NonFiniteError, match="Reject the whole chunk"):
            query(paths_of(q, SceneState()))


@pytest.mark.parametrize(
    "rotation",
    [
        np.diag([1.0, 1.0, -1.0]), np.zeros((3, 3)), np.eye(3) * 1.001,
        np.eye(3) + 1e-3 * np.eye(3, k=1), np.eye(3) + 1e-3 * np.eye(3, k=2),
        np.eye(3)[[1, 0, 2]],
    ],
)  # fmt: skip
def test_an_improper_rotation_is_refused(rotation):
    with pytest.raises(ContractError, match="orthonormal with determinant 1"):
        place(fcl.CollisionObject(fcl.Box(1, 1, 1)), rotation, np.zeros(3))


def test_what_stands_elsewhere_is_asked_where_it_stands(arm, model, random_scene, scene_path):
    """A scene is placed once for as long as it is asked about; another one is another."""
    rng = np.random.default_rng(3)
    q = near_configurations(arm, rng, 40)
    scenes = [random_scene(rng) for _ in range(4)]
    apart = [(CollisionModel(scene_path, arm), scene) for scene in scenes]
    alone = [[own.in_collision(row, scene) for row in q] for own, scene in apart]
    assert len({tuple(hit is None for hit in found) for found in alone}) == len(scenes)
    for at, row in enumerate(q):
        for found, scene in zip(alone, scenes, strict=True):
            assert model.in_collision(row, scene) == found[at]
