"""The geometric layer: does arm, hand or held object touch anything, at or between the rows?"""

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.action import GRIPPER
from genpolicy.feasibility.layers import Batch, Margins
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.robot.collision import CollisionModel, Hit, Paths

Array = NDArray[np.float64]

TOUCH_M = 1e-9  # a touch without depth is still a collision


def geometric(
    batch: Batch,
    q_rad: Array,
    *,
    collision: CollisionModel,
    settings: FeasibilitySettings,
    disabled: frozenset[str],
) -> tuple[Margins, list[str]]:
    """Collisions of the rows themselves, then of the motion from the last command through them.

    Args:
        batch: The chunks.
        q_rad: Their joint positions. Shape (B, n, 7).
        collision: Collision queries.
        settings: Clearances and contact phases.
        disabled: Checks that are off; the swept test is for chunks that the rows left open.

    Returns:
        Margins (lower bounds on the distance left, m; minus the depth for a hit; NaN for a swept
        test that was not made), and what touched what.
    """
    paths = _paths(batch, q_rad, settings)
    samples = collision.check_samples(paths)
    own_names = {shape.name for shape in collision.shapes.robot}
    margins: Margins = {
        "scene_collision": samples.clearance_m.copy(),
        "self_collision": samples.clearance_m.copy(),
        "swept_collision": np.full(len(q_rad), np.nan),
    }
    details = [_detail(hit) for hit in samples.hits]
    for i, hit in enumerate(samples.hits):
        if hit is not None:
            name = "self_collision" if hit.second in own_names else "scene_collision"
            margins["scene_collision"][i] = margins["self_collision"][i] = 0.0
            margins[name][i] = -_depth(hit)
    open_checks = [c for c in ("scene_collision", "self_collision") if c not in disabled]
    left = np.flatnonzero(np.all([margins[c] >= 0 for c in open_checks], axis=0)) if (
        open_checks
    ) else np.arange(len(q_rad))  # fmt: skip
    if len(left) and "swept_collision" not in disabled:
        swept = collision.check_swept(_subset(paths, left))
        for i, hit, clearance in zip(left.tolist(), swept.hits, swept.clearance_m, strict=True):
            margins["swept_collision"][i] = clearance if hit is None else -_depth(hit)
            details[i] = details[i] or _detail(hit)
    return margins, details


def _paths(batch: Batch, q_rad: Array, settings: FeasibilitySettings) -> Paths:
    openings = np.concatenate([batch.last_action[:, None], batch.actions], axis=1)
    contact = np.array([c.phase in settings.contact_phases for c in batch.contexts])
    return Paths(
        q_rad=np.concatenate([batch.q_cmd_rad[:, None], q_rad], axis=1),
        opening_m=openings[..., GRIPPER],
        held=batch.held(settings.held_opening_m),
        scenes=tuple(c.scene for c in batch.contexts),
        contact_allowed=contact,
        clearance_m=np.where(contact, settings.contact_clearance_m, settings.clearance_m),
    )


def _subset(paths: Paths, rows: NDArray[np.intp]) -> Paths:
    return Paths(
        q_rad=paths.q_rad[rows],
        opening_m=paths.opening_m[rows],
        held=paths.held[rows],
        scenes=tuple(paths.scenes[i] for i in rows),
        contact_allowed=paths.contact_allowed[rows],
        clearance_m=paths.clearance_m[rows],
    )


def _depth(hit: Hit) -> float:
    return max(hit.depth_m, TOUCH_M)


def _detail(hit: Hit | None) -> str:
    return "" if hit is None else f"{hit.first} and {hit.second} at row {hit.index}"
