"""Where an arm can stand and which way it can go, asked of the robot: material for corruptions."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from genpolicy.feasibility.cell import Cell
from genpolicy.robot.collision import Paths
from genpolicy.robot.scene_state import SceneState
from genpolicy.seeds import stream

Array = NDArray[np.float64]

SAMPLED = 40_000
SAMPLED_FOR_FOLDING = 1_500
KEPT = 24  # postures of one kind; the first that only one check refuses is used
OUT_OF_REACH = 0.5  # of the arm's reach, away from where the TCP is
STRETCHING = 200  # iterations until the arm has stretched as far as it goes
NEAR_M = 0.05  # outside the workspace, but this close to it
EDGE_RAD = 0.015  # from the end of a joint's range, where its next step leads beyond
FOLLOWING = 0.5  # of what a joint turns, where the arm makes the motion of its turn by all joints
PART = 0.9  # of its limit: what is to be within it keeps clear of its edge


@dataclass(frozen=True)
class Postures:
    """Joint positions of one robot, rad, each kind with one thing wrong. Shapes (n, J).

    Attributes:
        singular: Badly conditioned.
        tight: A joint within the margin of its position limit.
        edges: A joint hardly before its position limit, and the motion of the TCP (m, rad) that
            leads it beyond, so that only another branch reaches where the TCP goes.
        outside: The TCP just outside the workspace.
        folded: The robot touches itself; the TCP may be anywhere.
        stretched: Stretched towards a place out of reach, with its position and rotation.
    """

    singular: Array
    tight: Array
    edges: tuple[tuple[Array, Array], ...]
    outside: Array
    folded: Array
    stretched: tuple[tuple[Array, tuple[Array, Array]], ...]


_KNOWN: list[tuple[Cell, Postures]] = []


def postures_of(cell: Cell) -> Postures:
    """Postures of a cell's robot, the same ones every time; searched for once per cell."""
    for known, found in _KNOWN:
        if known is cell:
            return found
    found = _search(cell)
    _KNOWN.append((cell, found))
    return found


def _search(cell: Cell) -> Postures:
    arm, settings = cell.kinematics, cell.settings
    lower, upper = arm.lower_rad, arm.upper_rad
    q = stream(0, "corruption", "postures").uniform(lower, upper, (SAMPLED, len(lower)))
    room = np.minimum(q - lower, upper - q).min(axis=1)
    position, _ = arm.forward(q)
    box = np.array(cell.workspace.lower_m), np.array(cell.workspace.upper_m)
    beyond = np.maximum(box[0] - position, position - box[1]).max(axis=1)
    condition = arm.condition_number(q)
    roomy, good = room > settings.joint_margin_rad, condition < PART * settings.condition_limit
    return Postures(
        singular=q[roomy & (condition > settings.condition_limit) & (beyond < 0)][:KEPT],
        tight=q[(room > 0) & (room < PART * settings.joint_margin_rad) & good & (beyond < 0)][
            :KEPT
        ],
        edges=_edges(cell, q[(room > 0) & (room < EDGE_RAD) & good & (beyond < 0)]),
        outside=q[roomy & good & (beyond > 0.001) & (beyond < NEAR_M)][:KEPT],
        folded=_folded(cell, q[roomy & good][:SAMPLED_FOR_FOLDING])[:KEPT],
        stretched=_stretched(cell, q[roomy & good & (beyond < 0)][:KEPT]),
    )


def _edges(cell: Cell, q_rad: Array) -> tuple[tuple[Array, Array], ...]:
    """Those from which the smallest motion that turns their joint beyond its limit is small."""
    arm, found = cell.kinematics, []
    for q, jacobian in zip(q_rad, arm.jacobian(q_rad), strict=True):
        room = np.stack([q - arm.lower_rad, arm.upper_rad - q])
        end, joint = np.unravel_index(np.argmin(room), room.shape)
        turn = 2.0 * EDGE_RAD * (1.0 if end else -1.0)
        share = (np.linalg.pinv(jacobian) @ jacobian[:, joint])[joint]
        if share > FOLLOWING:
            found.append((q, jacobian[:, joint] * (turn / share)))
    return tuple(found[:KEPT])


def _folded(cell: Cell, q_rad: Array) -> Array:
    """Those in which two shapes of the robot touch."""
    count = len(q_rad)
    report = cell.collision.check_samples(
        Paths(
            q_rad=np.stack([q_rad, q_rad], axis=1),
            opening_m=np.zeros((count, 2)),
            held=np.zeros((count, 2), dtype=np.bool_),
            scenes=(SceneState(),) * count,
            contact_allowed=np.zeros(count, dtype=np.bool_),
            clearance_m=np.zeros(count),
        )
    )
    own = {shape.name for shape in cell.collision.shapes.robot}
    hit = [hit is not None and hit.second in own for hit in report.hits]
    return q_rad[np.array(hit, dtype=np.bool_)]


def _stretched(cell: Cell, q_rad: Array) -> tuple[tuple[Array, tuple[Array, Array]], ...]:
    """Where the arm ends when it goes on towards places out of its reach from some postures."""
    arm = cell.kinematics
    position, rotation = arm.forward(q_rad)
    ways = np.resize(directions()[:6], position.shape)
    targets = position + OUT_OF_REACH * arm.reach_m * ways
    found = arm.solve(targets, rotation, q_seed_rad=q_rad, iterations=STRETCHING)
    return tuple(zip(found.q_rad, zip(targets, rotation, strict=True), strict=True))


def directions() -> Array:
    """Unit vectors along the axes, both ways, and between them. Shape (18, 3)."""
    grid = np.array(np.meshgrid((0, 1, -1), (0, 1, -1), (0, 1, -1))).reshape(3, -1).T
    chosen = grid[np.isin(np.abs(grid).sum(axis=1), (1, 2))].astype(float)
    ordered = chosen[np.argsort(np.abs(chosen).sum(axis=1), kind="stable")]
    unit: Array = ordered / np.linalg.norm(ordered, axis=1, keepdims=True)
    return unit


def step_of(cell: Cell, q_rad: Array, twist: Array) -> Array:
    """Smallest joint step (J,), rad, that moves (m) and turns (rad) the TCP by `twist` (6,)."""
    step: Array = np.linalg.pinv(cell.kinematics.jacobian(q_rad[None])[0]) @ twist
    return step


def joint_steps(cell: Cell, q_rad: Array) -> Array:
    """Directions (n, J) in which joints move and the TCP does, those that move it least first.

    A motion that leaves the TCP where it is has no part in them: no pose would show it.
    """
    settings = cell.settings
    jacobian = cell.kinematics.jacobian(q_rad[None])[0]
    weight = np.repeat([1 / settings.tcp_speed_limit_m_s, 1 / settings.tcp_turn_limit_rad_s], 3)
    _, sizes, rows = np.linalg.svd(weight[:, None] * jacobian, full_matrices=False)
    found = rows[np.argsort(sizes)]
    both: Array = np.concatenate([found, -found])
    return both
