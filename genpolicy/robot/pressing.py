"""How deep a commanded pose lies inside of what may be touched there: what the controller presses.

An impedance controller that is told to go into a surface leans on it with its stiffness times the
way that is missing. That way is at least the shortest one out of the surface, which geometry knows;
so this is a lower bound of the force, and what exceeds a limit by it certainly presses too hard.
"""

import numpy as np
from numpy.typing import NDArray

from genpolicy.robot.collision import CollisionModel, Paths
from genpolicy.robot.narrowphase import require_finite

Array = NDArray[np.float64]


def pressed_depth_m(model: CollisionModel, paths: Paths) -> Array:
    """Deepest that what is held lies in the target, over the waypoints 1 to P - 1 of each path, m.

    Waypoint 0 is where the arm stands already. 0 where nothing is held, where it is free, or where
    the scene has no target.

    Args:
        model: Collision queries in the scene.
        paths: The paths; `contact_allowed`, `clearance_m` and `asked` are not read.

    Returns:
        Shape (B,).

    Raises:
        NonFiniteError: A joint position or an opening is not finite.
    """
    require_finite(paths.q_rad, paths.opening_m)
    deepest = np.zeros(len(paths.q_rad))
    columns = np.flatnonzero(model.broad.columns.target)
    if not len(columns):
        return deepest
    path, index = np.nonzero(paths.held[:, 1:])
    if not len(path):
        return deepest
    frames = model.kinematics.frames(paths.q_rad[path, index + 1])
    width = model.shapes.held_half_width_m
    opening = np.maximum(paths.opening_m[path, index + 1], width)
    bound = model.broad.lower_bounds(
        model.broad.centres(frames, opening), model.poses(paths.scenes)[path]
    )[:, columns]
    for i, place in np.argwhere(~(bound > 0)):
        depth = model.narrow.depth_m(
            frames,
            int(i),
            opening_m=float(opening[i]),
            column=int(columns[place]),
            scene=paths.scenes[int(path[i])],
        )
        deepest[path[i]] = max(deepest[path[i]], depth)
    return deepest
