"""Outlines: as large as the shapes are, where the scene and the pose of the tool put them."""

from dataclasses import replace

import numpy as np
import pytest

from genpolicy.contract.action import GRIPPER, join_action
from genpolicy.contract.chunk import Projected
from genpolicy.evidence.shadow.drawn_bodies import drawn_robot, drawn_scene
from genpolicy.feasibility.reasons import Reason, Unit
from genpolicy.feasibility.settings import LAYERS
from genpolicy.feasibility.verdict import LayerOutcome, LayerVerdict, Verdict, not_reached
from genpolicy.robot.shapes import Shape

CLOSED = 0.0


def verdict_at(row, *, layer="geometric", q_rad=None):
    """A verdict whose named layer rejected at a row."""
    told = LayerVerdict(
        layer, LayerOutcome.FAILED, Reason.SCENE_COLLISION, -1.0, Reason.SCENE_COLLISION, Unit.M,
        row=row,
    )  # fmt: skip
    layers = tuple(told if name == layer else not_reached(name) for name in LAYERS)
    return Verdict(layers, {}, (1, 4), q_rad=q_rad)


def extent(points):
    low, high = np.min(points, axis=0), np.max(points, axis=0)
    return (low + high) / 2, high - low


@pytest.fixture
def standing(demonstrated, shadow):
    """A chunk that stays where the arm stands, with a closed hand, and its context."""
    _, case, _ = demonstrated
    context = replace(
        case.context, last_action=np.concatenate([case.context.last_action[:GRIPPER], [CLOSED]])
    )
    position, rotation = shadow.checker.kinematics.forward(context.q_cmd)
    actions = np.tile(join_action(position, rotation, CLOSED), (4, 1))
    return Projected(replace(case.proposal, actions=actions), actions, 0.0, 0.0), context


def test_the_scene_stands_where_it_was_seen(shadow, demonstrated):
    _, case, _ = demonstrated
    scene, shapes = case.context.scene, shadow.checker.collision.shapes
    found = {body.name: body for body in drawn_scene(shadow, scene, ["post"])}
    (name,) = shadow.task.obstacles
    place, _ = scene.placement(shapes, name)
    centre, size = extent(found["post"].above_m)
    radius = next(s for s in shapes.scene if s.name == "post").half_size_m[0]
    np.testing.assert_allclose(centre, place[:2], atol=1e-6)
    np.testing.assert_allclose(size, 2 * radius, atol=1e-6)
    assert [body.touches for body in found.values()].count(True) == 1 and found["post"].touches
    assert found["post"].kind == "obstacle"
    assert {b.kind for b in found.values() if b.name.startswith("fixture")} == {"target"}
    top = max(z for _, z in found["fixture_front"].aside_m)
    assert top == pytest.approx(scene.target_position_m(shapes)[2])


def test_the_tool_of_a_pose_is_where_the_joints_of_that_pose_put_it(shadow, standing):
    projected, context = standing
    cell, collision = shadow.checker.cell, shadow.checker.collision
    found = {b.name: b for b in drawn_robot(cell, projected, context, verdict_at(2), [])}
    tool = [shape for shape in collision.shapes.robot if shape.tool]
    assert set(found) == {shape.name for shape in tool} and "held" in found
    opening = collision.shapes.held_half_width_m
    placements = collision.placements(context.q_cmd, opening_m=opening)
    for shape, (_, position) in zip(collision.shapes.robot, placements, strict=True):
        if shape.tool:
            for outline, axes in ((found[shape.name].above_m, [0, 1]),
                                  (found[shape.name].aside_m, [0, 2])):  # fmt: skip
                np.testing.assert_allclose(extent(outline)[0], position[axes], atol=2e-6)
    assert not any(body.touches for body in found.values())


def test_the_tool_goes_with_the_pose(shadow, standing):
    projected, context = standing
    cell = shadow.checker.cell
    moved = projected.actions.copy()
    moved[2, :3] += (0.01, -0.02, 0.03)
    first, then = (
        {b.name: extent(b.above_m)[0] for b in drawn_robot(cell, p, context, verdict_at(2), [])}
        for p in (projected, replace(projected, actions=moved))
    )
    for name, centre in first.items():
        np.testing.assert_allclose(then[name] - centre, (0.01, -0.02), atol=2e-6)
    # The first layer judges what was sampled, so its tool stands there.
    early = drawn_robot(
        cell, replace(projected, actions=moved), context, verdict_at(2, layer=LAYERS[0]), []
    )
    for body in early:
        np.testing.assert_allclose(extent(body.above_m)[0], first[body.name], atol=2e-6)


def test_an_open_hand_holds_nothing(shadow, standing):
    projected, context = standing
    opened = projected.actions.copy()
    opened[1:, GRIPPER] = 0.04
    chunk = replace(projected, actions=opened)
    names = {b.name for b in drawn_robot(shadow.checker.cell, chunk, context, verdict_at(2), [])}
    assert "hand" in names and "held" not in names


def test_a_link_that_touches_is_drawn_from_the_joints(shadow, standing):
    projected, context = standing
    cell, q_rad = shadow.checker.cell, np.tile(context.q_cmd, (3, 1))
    found = drawn_robot(cell, projected, context, verdict_at(2, q_rad=q_rad), ["link5", "post"])
    assert [body.name for body in found if body.touches] == ["link5"]
    without = drawn_robot(cell, projected, context, verdict_at(2), ["link5", "post"])
    assert "link5" not in {body.name for body in without}


def test_without_a_row_or_a_pose_there_is_no_tool(shadow, standing):
    projected, context = standing
    cell = shadow.checker.cell
    assert drawn_robot(cell, projected, context, verdict_at(None), []) == []
    broken = projected.actions.copy()
    for column in (0, slice(3, 9)):
        actions = broken.copy()
        actions[2, column] = np.nan if column == 0 else 0.0
        chunk = replace(projected, actions=actions)
        assert drawn_robot(cell, chunk, context, verdict_at(2), []) == []


@pytest.mark.parametrize(("kind", "half", "size"), [
    ("box", (0.1, 0.2, 0.3), (0.2, 0.4, 0.6)), ("cylinder", (0.1, 0.1, 0.3), (0.2, 0.2, 0.6)),
    ("capsule", (0.1, 0.1, 0.3), (0.2, 0.2, 0.8)), ("sphere", (0.1, 0.1, 0.1), (0.2, 0.2, 0.2)),
])  # fmt: skip
def test_an_outline_is_as_large_as_its_shape(shadow, monkeypatch, kind, half, size):
    shape = Shape(
        name="it", body="world", kind=kind, half_size_m=np.array(half), frame=-1,
        rotation=np.eye(3), position_m=np.zeros(3), slide=np.zeros(3),
    )  # fmt: skip
    collision = shadow.checker.collision
    alone = replace(collision.shapes, scene=(shape,))
    monkeypatch.setattr(collision, "shapes", alone)
    monkeypatch.setattr(
        collision, "scene_placements", lambda scene: [(np.eye(3), np.array([1.0, 2.0, 3.0]))]
    )
    (body,) = drawn_scene(shadow, None, [])
    for outline, axes in ((body.above_m, [0, 1]), (body.aside_m, [0, 2])):
        centre, found = extent(outline)
        np.testing.assert_allclose(centre, np.array([1.0, 2.0, 3.0])[axes], atol=1e-6)
        np.testing.assert_allclose(found, np.array(size)[axes], atol=1e-6)
