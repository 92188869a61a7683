"""The broad phase of collision, configuration by configuration (`robot.broadphase`)."""

import math

import numpy as np
from numpy.typing import NDArray

from genpolicy.compiled import compiled

Array = NDArray[np.float64]
Integers = NDArray[np.int64]


@compiled("void(f8[:,:,:,::1], f8[:,:,::1], f8[::1], i8[::1], f8[:,::1], f8[:,::1], f8[:,:,::1])")
def centres(
    rotation: Array,
    position: Array,
    opening: Array,
    frame: Integers,
    local: Array,
    slide: Array,
    result: Array,
) -> None:
    """Centres of all spheres, m.

    Args:
        rotation: Frames of N configurations. Shape (N, J + 1, 3, 3).
        position: Their positions, m. Shape (N, J + 1, 3).
        opening: Gripper opening, m. Shape (N,).
        frame: Of each sphere, below 0 for the base. Shape (S,).
        local: Centre in that frame, m. Shape (S, 3).
        slide: Direction in which the opening moves it. Shape (S, 3).
        result: Written. Shape (N, S, 3).
    """
    for n in range(len(opening)):
        for s in range(len(frame)):
            x = local[s, 0] + slide[s, 0] * opening[n]
            y = local[s, 1] + slide[s, 1] * opening[n]
            z = local[s, 2] + slide[s, 2] * opening[n]
            f = frame[s]
            if f < 0:
                result[n, s, 0], result[n, s, 1], result[n, s, 2] = x, y, z
                continue
            for i in range(3):
                turned = rotation[n, f, i, 0] * x + rotation[n, f, i, 1] * y
                turned += rotation[n, f, i, 2] * z
                result[n, s, i] = turned + position[n, f, i]


@compiled("f8(f8[:,:,::1], i8, i8, i8, f8[:,:,::1], i8, f8[:,::1])")
def to_box(
    spheres: Array, n: int, first: int, last: int, poses: Array, body: int, boxes: Array
) -> float:
    """Least signed distance of the centres from `first` to `last` to a body's box, m.

    Args:
        spheres: Centres, m. Shape (N, S, 3).
        n: Configuration.
        first: First of them.
        last: Behind the last one.
        poses: x, y, z (m), cosine and sine of the yaw of each body. Shape (N, bodies, 5).
        body: Which.
        boxes: Middle and half edges in the body, m. Shape (bodies, 6).
    """
    cosine, sine = poses[n, body, 3], poses[n, body, 4]
    least, deepest = np.inf, 0.0
    for s in range(first, last):
        x, y = spheres[n, s, 0] - poses[n, body, 0], spheres[n, s, 1] - poses[n, body, 1]
        z = spheres[n, s, 2] - poses[n, body, 2]
        a = abs(cosine * x + sine * y - boxes[body, 0]) - boxes[body, 3]
        b = abs(cosine * y - sine * x - boxes[body, 1]) - boxes[body, 4]
        c = abs(z - boxes[body, 2]) - boxes[body, 5]
        outermost = a if a > b else b
        outermost = outermost if outermost > c else c
        deepest = outermost if outermost < deepest else deepest
        a, b, c = (a if a > 0.0 else 0.0), (b if b > 0.0 else 0.0), (c if c > 0.0 else 0.0)
        away = a * a + b * b + c * c
        least = away if away < least else least
    return math.sqrt(least) + deepest


@compiled("f8(f8[:,:,::1], i8, i8, i8, i8, i8)")
def between(spheres: Array, n: int, first: int, last: int, begin: int, end: int) -> float:
    """Least distance of the centres from `first` to `last` to those from `begin` to `end`, m."""
    least = np.inf
    for s in range(first, last):
        x, y, z = spheres[n, s, 0], spheres[n, s, 1], spheres[n, s, 2]
        for t in range(begin, end):
            a, b, c = x - spheres[n, t, 0], y - spheres[n, t, 1], z - spheres[n, t, 2]
            away = a * a + b * b + c * c
            least = away if away < least else least
    return math.sqrt(least)


@compiled("void(f8[:,:,::1], f8[:,:,::1], f8[:,::1], i8[::1], f8[::1], i8[:,::1], f8[:,::1])")
def lower_bounds(
    spheres: Array,
    poses: Array,
    boxes: Array,
    starts: Integers,
    radius: Array,
    pairs: Integers,
    result: Array,
) -> None:
    """Lower bound on the distance of every pair, m.

    Args:
        spheres: Centres, m. Shape (N, S, 3).
        poses: Of each body, as of `to_box`. Shape (N, bodies, 5).
        boxes: As of `to_box`. Shape (bodies, 6).
        starts: First sphere of each shape, and behind the last one. Shape (R + 1,).
        radius: Of the spheres of each shape, m. Shape (R,).
        pairs: Shape, body (below 0: none), other shape of each pair. Shape (3, C).
        result: Written. Shape (N, C).
    """
    for n in range(len(spheres)):
        for column in range(pairs.shape[1]):
            shape, body, other = pairs[0, column], pairs[1, column], pairs[2, column]
            first, last = starts[shape], starts[shape + 1]
            if body >= 0:
                gap = to_box(spheres, n, first, last, poses, body, boxes)
                result[n, column] = gap - radius[shape]
            else:
                gap = between(spheres, n, first, last, starts[other], starts[other + 1])
                result[n, column] = gap - radius[shape] - radius[other]


@compiled(
    "void(f8[:,:,:,::1], f8[:,:,:,::1], f8[:,:,::1], f8[:,:,::1], f8[::1], i8[::1], i8[::1],"
    " f8[::1], i8[:,::1], f8[:,::1])"
)
def travel(
    rotation: Array,
    turned: Array,
    spheres: Array,
    moved: Array,
    bend: Array,
    frame: Integers,
    starts: Integers,
    radius: Array,
    pairs: Integers,
    result: Array,
) -> None:
    """How far any point of a pair is from the nearer end of a short motion, at most, m.

    Args:
        rotation: Of the frames at one end. Shape (N, J + 1, 3, 3).
        turned: At the other end.
        spheres: Centres at one end, m. Shape (N, S, 3).
        moved: At the other end.
        bend: Most that a path bends away from its chord, m. Shape (N,).
        frame: As of `centres`. Shape (S,).
        starts: As of `lower_bounds`. Shape (R + 1,).
        radius: As of `lower_bounds`. Shape (R,).
        pairs: As of `lower_bounds`. Shape (3, C).
        result: Written; of a pair of own shapes the sum over both. Shape (N, C).
    """
    shapes = len(radius)
    own = np.empty(shapes)
    for n in range(len(bend)):
        for shape in range(shapes):
            f, turn = frame[starts[shape]], 0.0
            if f >= 0:
                for i in range(3):
                    for j in range(3):
                        d = rotation[n, f, i, j] - turned[n, f, i, j]
                        turn += d * d
                turn = math.sqrt(turn) / math.sqrt(2.0)
            farthest = 0.0
            for s in range(starts[shape], starts[shape + 1]):
                x = moved[n, s, 0] - spheres[n, s, 0]
                y = moved[n, s, 1] - spheres[n, s, 1]
                z = moved[n, s, 2] - spheres[n, s, 2]
                away = x * x + y * y + z * z
                farthest = away if away > farthest else farthest
            own[shape] = (math.sqrt(farthest) + turn * radius[shape]) / 2 + bend[n]
        for column in range(pairs.shape[1]):
            far = own[pairs[0, column]]
            if pairs[1, column] < 0:
                far += own[pairs[2, column]]
            result[n, column] = far
