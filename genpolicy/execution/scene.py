"""Where the movable bodies of a scene stand, and how far they have moved since.

A chunk is checked in one scene: against its obstacles, on the way to its target. Where a body
stands elsewhere now, nobody checked the chunk in this scene.
"""

import math
from collections.abc import Mapping

import numpy as np

Scene = Mapping[str, tuple[float, ...]]
"""Bodies by name: x, y, z, m, and a unit quaternion w, x, y, z."""

LEVER_M = 0.1
"""A turn of a body is told by how far it moves a point this far from the body's origin."""
POSITION, TURN = slice(0, 3), slice(3, 7)
UNIT_TOLERANCE = 1e-6


def read_scene(poses: object) -> Scene | None:
    """Bodies as somebody says where they stand; None of what says nothing that can be read."""
    try:
        found = {
            name: tuple(np.concatenate([np.ravel(np.asarray(part, float)) for part in pose]))
            for name, pose in poses.items()  # type: ignore[attr-defined]
        }
        return found if all(map(_stands, found, found.values())) else None
    except Exception:  # of whatever it is, reading it may raise anything
        return None


def moved_m(checked: Scene | None, seen: Scene | None) -> float:
    """How far the body that moved furthest has, m: its origin, or a point `LEVER_M` from there.

    Infinite where either is unknown, or where a body is in one of them alone.
    """
    if checked is None or seen is None or checked.keys() != seen.keys():
        return math.inf
    return max((_way_m(checked[name], seen[name]) for name in checked), default=0.0)


def _way_m(before: tuple[float, ...], now: tuple[float, ...]) -> float:
    if before == now:
        return 0.0
    shift_m = math.dist(before[POSITION], now[POSITION])
    alike = abs(sum(a * b for a, b in zip(before[TURN], now[TURN], strict=True)))
    return shift_m + 2.0 * LEVER_M * math.sqrt(max(1.0 - alike * alike, 0.0))


def _stands(name: object, pose: tuple[float, ...]) -> bool:
    """A body with a name, a place and a turn."""
    finite = len(pose) == TURN.stop and all(map(math.isfinite, pose))
    return isinstance(name, str) and finite and abs(math.hypot(*pose[TURN]) - 1) <= UNIT_TOLERANCE
