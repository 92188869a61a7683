"""The geometric layer: does arm, hand or held object touch anything, at or between the rows?"""

from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.chunk import Projected
from genpolicy.feasibility.batch import Batch, Margins
from genpolicy.feasibility.cell import Cell
from genpolicy.feasibility.context import Context
from genpolicy.robot.collision import CollisionReport, Hit, Paths

Array = NDArray[np.float64]

TOUCH_M = 1e-9  # a touch without depth is still a collision
PERIOD_ROUNDING = 1e-6  # of a period: times are sums of periods


def margins(batch: Batch, cell: Cell) -> Margins:
    """Collisions of the rows themselves, with the scene and of the robot with itself.

    ==================  =======================================================================
    scene_collision     lower bound on distance - clearance, m; - depth (at least 1 nm) of a hit
    self_collision      the same for pairs of the robot's own shapes
    ==================  =======================================================================

    In contact phases what is held is left to the contact layer.

    The clearance is `contact_clearance_m` in contact phases and `clearance_m` elsewhere. Of a
    chunk that hits, the check that did not notice it has the margin 0.
    """
    report = cell.collision.check_samples(paths_of(batch, cell, "free"))
    own_names = {shape.name for shape in cell.collision.shapes.robot}
    values = {
        "scene_collision": report.clearance_m.copy(),
        "self_collision": report.clearance_m.copy(),
    }
    for i, hit in enumerate(report.hits):
        if hit is not None:
            name = "self_collision" if hit.second in own_names else "scene_collision"
            values["scene_collision"][i] = values["self_collision"][i] = 0.0
            values[name][i] = -depth_m(hit)
    return Margins(values, _details(report))


def swept_margins(batch: Batch, cell: Cell) -> Margins:
    """Collisions of the motion from the last command through the rows.

    ==================  =======================================================================
    swept_collision     lower bound on distance - clearance, m; - depth (at least 1 nm) of a hit
    ==================  =======================================================================

    The most expensive of all questions, and therefore asked of those chunks only whose rows
    passed.
    """
    report = cell.collision.check_swept(paths_of(batch, cell, "free"))
    return Margins({"swept_collision": _left_m(report)}, _details(report))


def measured_margins(batch: Batch, cell: Cell) -> Margins:
    """Collisions of the way from where the arm was measured to its last command.

    ==================  =======================================================================
    measured_collision  lower bound on distance, m; - depth (at least 1 nm) of a hit
    ==================  =======================================================================

    An arm that was pushed, or that stands, comes to the first row another way than its commands
    do. No clearance is asked: that belongs to what is commanded.
    """
    report = cell.collision.check_swept(from_measured(batch, cell, "free"))
    return Margins({"measured_collision": _left_m(report)}, _details(report))


def from_measured(batch: Batch, cell: Cell, asked: Literal["held", "free"]) -> Paths:
    """The way from where the arm was measured to its last command, without clearance.

    It leads by the commands that are known since the measurement: an arm that was seen a while
    ago has followed them, and the straight way to here would cut its corners.
    """
    pairs = zip(batch.projected, batch.contexts, strict=True)
    ways = [_known_way(chunk, context, cell.action_period_s) for chunk, context in pairs]
    points, paths = max(map(len, ways)), paths_of(batch, cell, asked)
    every = np.arange(points)  # a shorter way stands at its end
    return replace(
        paths,
        q_rad=np.stack([way[np.minimum(every, len(way) - 1)] for way in ways]),
        opening_m=np.repeat(paths.opening_m[:, :1], points, axis=1),
        held=np.repeat(paths.held[:, :1], points, axis=1),
        clearance_m=np.zeros(len(batch)),
    )


def _known_way(chunk: Projected, context: Context, period_s: float) -> Array:
    """Measured state, commands of whole periods since, last command. Shape (n, J), n >= 2."""
    begins_s = chunk.metadata.action_start_time_s + context.first_index * period_s
    since = int((begins_s - context.measured_at_s) / period_s + PERIOD_ROUNDING)
    known = context.q_cmd_history[max(len(context.q_cmd_history) - max(since, 0), 0) :]
    return np.concatenate([context.q_meas[None], known, context.q_cmd[None]])


def _left_m(report: CollisionReport) -> Array:
    """Clearance that is left of each path, m; - depth of a hit. Shape (B,)."""
    pairs = zip(report.hits, report.clearance_m, strict=True)
    return np.array([clearance if hit is None else -depth_m(hit) for hit, clearance in pairs])


def _details(report: CollisionReport) -> tuple[str, ...]:
    return tuple(detail_of(hit) for hit in report.hits)


def paths_of(batch: Batch, cell: Cell, asked: Literal["held", "free"]) -> Paths:
    """The motion of chunks from the last command on, and which pairs of it are asked about."""
    settings = cell.settings
    contact = batch.in_phases(cell.contact_phases)
    return Paths(
        q_rad=np.concatenate([batch.q_cmd_rad[:, None], batch.solved.q_rad], axis=1),
        opening_m=batch.openings_m,
        held=batch.held(settings.held_opening_m),
        scenes=tuple(c.scene for c in batch.contexts),
        contact_allowed=contact,
        clearance_m=np.where(contact, settings.contact_clearance_m, settings.clearance_m),
        asked=asked,
    )


def depth_m(hit: Hit) -> float:
    """How deep a hit is, m; more than nothing."""
    return max(hit.depth_m, TOUCH_M)


def detail_of(hit: Hit | None) -> str:
    """What touched what, and where; empty without a hit."""
    return "" if hit is None else f"{hit.first} and {hit.second} at row {hit.index}"
