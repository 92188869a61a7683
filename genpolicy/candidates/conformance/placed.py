"""Do a candidate's chunks begin where the robot is?

An arm moves from where it stands, whichever way it takes: the first action of a chunk lies no
farther from the measured pose than a fast one steps. That tells another origin from
another way to do the task, since two good policies part along a chunk and not at its beginning.
What is less than such a step is told from the recorded first action only, and may be a bias.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.action import GRIPPER, POSITION, ROTATION
from genpolicy.contract.rotation import angle_between, rotation_from_6d
from genpolicy.statistics.intervals import order_statistic_interval

Array = NDArray[np.float64]

STEP_QUANTILE = 0.95
"""Recorded first actions lie no farther from the robot than this share of them."""
FASTER = 2.0
"""A good policy may be as much faster than the recordings, always in one direction."""
CONFIDENCE = 0.99
SMALL_TURN_RAD = 0.05
"""Three degrees: what a good policy may be off where recordings hardly turn."""
PLACES = ("x", "y", "z", "x of the tool", "y of the tool", "z of the tool")


@dataclass(frozen=True)
class Offset:
    """One number of first actions, in the middle over moments.

    Attributes:
        name: Which.
        low: Lower end of the median of candidate minus measured, m.
        high: Upper end.
        step: What a policy twice as fast as the recordings steps, m; infinite for the gripper,
            which may be commanded far from where an object stops it.
        apart_low: Lower end of the median of candidate minus recorded, m.
        apart_high: Upper end.
    """

    name: str
    low: float
    high: float
    step: float
    apart_low: float
    apart_high: float


def offsets(drawn: Array, recorded: Array, measured: Array) -> list[Offset]:
    """How far first actions lie from where the robot was; none where that is not known.

    Over an invocation's candidates the median is taken, so that noise of the draws is no offset.

    Args:
        drawn: Candidates' chunks, finite. Shape (M, N, K, 10).
        recorded: Shape (M, K, 10).
        measured: NaN where the observation does not say. Shape (M, 10).
    """
    theirs, ours = np.median(drawn[:, :, 0], axis=1), recorded[:, 0]
    level = 1.0 - (1.0 - CONFIDENCE) / (len(PLACES) + 1)
    turned = rotation_from_6d(measured[:, ROTATION])
    found = []
    for names, frame in ((PLACES[:3], None), (PLACES[3:], turned)):
        steps, before = (_seen_from(frame, of - measured) for of in (theirs, ours))
        for axis, name in enumerate(names):
            known = np.isfinite(steps[:, axis])
            if not known.all():
                continue
            low, high = order_statistic_interval(steps[:, axis], 0.5, level)
            step = FASTER * float(np.quantile(np.abs(before[:, axis]), STEP_QUANTILE))
            apart = order_statistic_interval(steps[:, axis] - before[:, axis], 0.5, level)
            found.append(Offset(name, low, high, step, *apart))
    opened = theirs[:, GRIPPER] - measured[:, GRIPPER]
    if np.isfinite(opened).all():
        apart = order_statistic_interval(theirs[:, GRIPPER] - ours[:, GRIPPER], 0.5, level)
        found.append(
            Offset("gripper", *order_statistic_interval(opened, 0.5, level), np.inf, *apart)
        )
    return found


def _seen_from(frame: Array | None, moved: Array) -> Array:
    place: Array = moved[:, POSITION]
    return place if frame is None else np.einsum("mji,mj->mi", frame, place)


def turned_away(chunks: Array, recorded: Array, measured: Array) -> tuple[int, int, float]:
    """At how many moments a chunk begins turned farther from the hand than recordings do.

    Where the observation does not say how the hand is turned, the recorded first action stands for
    it.

    Args:
        chunks: Shape (M, K, 10).
        recorded: Likewise.
        measured: Shape (M, 10).

    Returns:
        That number, the number of moments, and the angle: twice a recorded step, rad.
    """
    ours, theirs = (rotation_from_6d(of[:, 0, ROTATION]) for of in (recorded, chunks))
    hand = rotation_from_6d(measured[:, ROTATION])
    hand = np.where(np.isnan(hand).any(axis=(1, 2), keepdims=True), ours, hand)
    step = float(np.nanquantile(angle_between(ours, hand), STEP_QUANTILE))
    step = max(FASTER * step, SMALL_TURN_RAD)
    # A rotation that is none is turned away: NaN is not within any angle.
    away = ~(angle_between(theirs, hand) <= step)
    return int(away.sum()), len(away), step
