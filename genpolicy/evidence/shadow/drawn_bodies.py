"""Outlines of the scene, and of the tool at one action, as a drawing shows them."""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.action import GRIPPER, POSITION, ROTATION
from genpolicy.contract.chunk import Projected
from genpolicy.contract.rotation import rotation_from_6d
from genpolicy.evidence.documents.gallery import DrawnBody
from genpolicy.evidence.shadow.shadow import Shadow
from genpolicy.feasibility.cell import Cell
from genpolicy.feasibility.context import Context
from genpolicy.feasibility.settings import LAYERS
from genpolicy.feasibility.verdict import Verdict
from genpolicy.robot.outlines import outlines
from genpolicy.robot.scene_state import SceneState
from genpolicy.robot.shapes import HELD, Shape

Array = NDArray[np.float64]

DECIMALS = 6  # of metres: a thousandth of a millimetre, below what a drawing or a scene knows


def drawn_scene(shadow: Shadow, scene: SceneState, touching: Sequence[str]) -> list[DrawnBody]:
    """Every shape of the scene where it stood.

    Args:
        shadow: Names what stands in the way.
        scene: Where the movable bodies stood.
        touching: Names of the shapes that touch.
    """
    collision = shadow.checker.collision
    kinds = {collision.shapes.target_body: "target"} | dict.fromkeys(
        shadow.task.obstacles, "obstacle"
    )
    placements = collision.scene_placements(scene)
    return [
        _drawn(shape, kinds.get(shape.body, "scene"), rotation, position, touching)
        for shape, (rotation, position) in zip(collision.shapes.scene, placements, strict=True)
    ]


def drawn_robot(
    cell: Cell, projected: Projected, context: Context, verdict: Verdict, touching: Sequence[str]
) -> list[DrawnBody]:
    """The tool at the offending action, and what else of the robot touches something there.

    What hangs behind the last link stands where the pose says, whether joints reach it or not; a
    link where the joints say, if they are known.

    Args:
        cell: The robot.
        projected: The chunk.
        context: What it was checked against.
        verdict: With the offending row.
        touching: Names of the shapes that touch.
    """
    told = verdict.first
    if told is None or told.row is None:
        return []
    by_sample = told.name == LAYERS[0]
    action = (projected.proposal.actions if by_sample else projected.actions)[told.row]
    rotation = rotation_from_6d(action[None, ROTATION])[0]
    if not (np.all(np.isfinite(action)) and np.all(np.isfinite(rotation))):
        return []
    held = _is_held(cell, projected.actions[: told.row + 1], context)
    opening_m = max(float(action[GRIPPER]), cell.collision.shapes.held_half_width_m if held else 0)
    found = [
        _drawn(shape, "robot", turned, moved, touching)
        for shape, turned, moved in _tool_at(cell, context, opening_m, action[POSITION], rotation)
        if shape.name != HELD or held
    ]
    if verdict.q_rad is not None and told.row >= context.first_index:
        q_rad = verdict.q_rad[told.row - context.first_index]
        placements = cell.collision.placements(q_rad, opening_m=opening_m)
        found += [
            _drawn(shape, "robot", turned, moved, touching)
            for shape, (turned, moved) in zip(cell.collision.shapes.robot, placements, strict=True)
            if not shape.tool and shape.name in touching
        ]
    return found


def _is_held(cell: Cell, actions: Array, context: Context) -> bool:
    """Whether the hand has stayed closed around something up to the last of some actions."""
    if not cell.collision.shapes.held_reach_m > 0:
        return False
    openings = np.append(actions[context.first_index :, GRIPPER], context.last_action[GRIPPER])
    return bool(np.all(openings <= cell.settings.held_opening_m))


def _tool_at(
    cell: Cell, context: Context, opening_m: float, position_m: Array, rotation: Array
) -> Iterator[tuple[Shape, Array, Array]]:
    """Every shape of the tool with its rotation and position where the TCP has a pose."""
    here, turned = cell.kinematics.forward(context.q_cmd)
    placements = cell.collision.placements(context.q_cmd, opening_m=opening_m)
    for shape, (own, place) in zip(cell.collision.shapes.robot, placements, strict=True):
        if shape.tool:
            moved = position_m + rotation @ turned.T @ (np.asarray(place) - here)
            yield shape, rotation @ turned.T @ np.asarray(own), moved


def _drawn(
    shape: Shape, kind: str, rotation: Array, position_m: Array, touching: Sequence[str]
) -> DrawnBody:
    above, aside = outlines([(shape, rotation, position_m)])
    return DrawnBody(
        name=shape.name,
        kind=kind,
        touches=shape.name in touching,
        above_m=np.round(above, DECIMALS).tolist(),
        aside_m=np.round(aside, DECIMALS).tolist(),
    )
