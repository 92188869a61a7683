"""Which paths the spheres alone clear, at their points or between them (`robot.collision`)."""

import numpy as np
from numpy.typing import NDArray

from genpolicy.compiled import compiled
from genpolicy.feasibility.kernels.arm import place_all
from genpolicy.feasibility.kernels.spheres import centres, lower_bounds, travel

Array = NDArray[np.float64]
Booleans = NDArray[np.bool_]
Integers = NDArray[np.int64]


@compiled(
    "void(f8[:,:,::1], f8[:,:,:,::1], f8[:,::1], f8, f8[:,:,::1], i8[::1], i8[::1], f8[::1],"
    " i8[:,::1], f8[:,::1])"
)
def ways_of(
    q: Array,
    rotation: Array,
    opening: Array,
    reach: float,
    spheres: Array,
    frame: Integers,
    starts: Integers,
    radius: Array,
    pairs: Integers,
    result: Array,
) -> None:
    """How far any point of a pair is from the nearer end of each segment of path 0, at most, m.

    Args:
        q: Paths, rad. Shape (1, P, J).
        rotation: Frames at the points. Shape (P, J + 1, 3, 3).
        opening: At the points, m. Shape (1, P).
        reach: No point of the arm is farther from a joint axis, m.
        spheres: Centres at the points, m. Shape (P, S, 3).
        frame: As of `spheres.centres`.
        starts: As of `spheres.lower_bounds`.
        radius: As of `spheres.lower_bounds`.
        pairs: As of `spheres.lower_bounds`.
        result: Written. Shape (P - 1, C).
    """
    points = q.shape[1]
    bend = np.empty(points - 1)
    for segment in range(points - 1):
        turned = 0.0
        for joint in range(q.shape[2]):
            turned += abs(q[0, segment + 1, joint] - q[0, segment, joint])
        opened = abs(opening[0, segment + 1] - opening[0, segment])
        bend[segment] = (reach * turned**2 + 2 * opened * turned) / 8
    travel(
        rotation[:-1], rotation[1:], spheres[:-1], spheres[1:], bend, frame, starts, radius, pairs,
        result,
    )  # fmt: skip


@compiled("f8(f8[:,::1], f8[:,::1], b1[::1], b1[:,::1], b1, f8)")
def least_left(
    bounds: Array,
    ways: Array,
    held: Booleans,
    asked: Booleans,
    swept: bool,
    clearance: float,
) -> float:
    """Least distance left over the pairs that are asked about, m; inf where there are none.

    Args:
        bounds: Lower bounds on the distance at the points, m. Shape (P, C).
        ways: What a segment takes off them, m; not read unless swept. Shape (P - 1, C).
        held: The object is in the hand at the point. Shape (P,).
        asked: Pairs that count with an empty hand, and with the object. Shape (2, C).
        swept: Of the segments; else of the points behind the first.
        clearance: Distance to keep, m.
    """
    least = np.inf
    for segment in range(len(bounds) - 1):
        has = held[segment + 1] or (swept and held[segment])
        for column in range(bounds.shape[1]):
            if not asked[1 if has else 0, column]:
                continue
            left = bounds[segment + 1, column]
            if swept:
                before = bounds[segment, column]
                left = (before if before < left else left) - ways[segment, column]
            left -= clearance
            least = left if left < least else least
    return least


@compiled(
    "void(f8[:,:,::1], f8[:,::1], f8[:,:,::1], f8[:,::1], b1[:,::1], f8[:,:,::1], b1[:,:,::1],"
    " f8[::1], b1, f8, i8[::1], f8[:,::1], f8[:,::1], f8[:,::1], i8[::1], f8[::1], i8[:,::1],"
    " f8[::1])"
)
def clear(
    turns: Array,
    offsets: Array,
    q: Array,
    opening: Array,
    held: Booleans,
    poses: Array,
    asked: Booleans,
    clearance: Array,
    swept: bool,
    reach: float,
    frame: Integers,
    local: Array,
    slide: Array,
    boxes: Array,
    starts: Integers,
    radius: Array,
    pairs: Integers,
    least: Array,
) -> None:
    """`least_left` of B paths; what is negative the spheres do not clear.

    Args:
        turns: As of `arm.place`.
        offsets: As of `arm.place`.
        q: Paths, rad. Shape (B, P, J).
        opening: At the points, m. Shape (B, P).
        held: The object is in the hand at the point. Shape (B, P).
        poses: Of the scene's bodies, as of `spheres.to_box`. Shape (B, bodies, 5).
        asked: Per path, as of `least_left`. Shape (B, 2, C).
        clearance: Distance to keep, m. Shape (B,).
        swept: As of `least_left`.
        reach: As of `ways_of`.
        frame: As of `spheres.centres`; so are local and slide.
        local: See there.
        slide: See there.
        boxes: As of `spheres.lower_bounds`; so are starts, radius and pairs.
        starts: See there.
        radius: See there.
        pairs: See there.
        least: Written, m. Shape (B,).
    """
    points, places, columns = q.shape[1], len(turns), pairs.shape[1]
    rotation, position = np.empty((points, places, 3, 3)), np.empty((points, places, 3))
    spheres, here = np.empty((points, len(frame), 3)), np.empty((points, *poses.shape[1:]))
    bounds, ways = np.empty((points, columns)), np.zeros((points - 1, columns))
    for path in range(len(q)):
        place_all(turns, offsets, q[path], rotation, position)
        centres(rotation, position, opening[path], frame, local, slide, spheres)
        here[:] = poses[path]
        lower_bounds(spheres, here, boxes, starts, radius, pairs, bounds)
        if swept:
            ways_of(q[path : path + 1], rotation, opening[path : path + 1], reach, spheres,
                    frame, starts, radius, pairs, ways)  # fmt: skip
        least[path] = least_left(bounds, ways, held[path], asked[path], swept, clearance[path])
