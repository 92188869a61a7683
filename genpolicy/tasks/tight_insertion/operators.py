"""Operators who feel for the hole: down, and where the peg stands on the rim, up and aside.

They see where the hole is, and not how the peg sits in the grasp. Around where they aim they try
points of a ring, one after the other; which way round and where they begin is their own choice,
drawn by nothing that is observed, so that the search has modes as the way around the post has.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from genpolicy.tasks.tabletop_insertion import scene
from genpolicy.tasks.tabletop_insertion.experts import Operator, Order
from genpolicy.tasks.tabletop_insertion.world import TabletopWorld
from genpolicy.tasks.tight_insertion.start import TightStart

Array = NDArray[np.float64]

RING_M, RING = 0.0018, 6
ROUNDS = 2
LIFT_M = 0.008
"""How high above the rim the tip is carried to the next point."""
ENTERED_M = 0.004
"""Deeper than the chamfer the tip is in the hole."""
PRESSED_PERIODS = 2
CREEP_M_S = 0.04
"""Slower than the 3 mm a period that may be pulled out of a contact."""
AROUND = ("clockwise", "counterclockwise")


class SearchingOperator(Operator):
    """Demonstrates one episode; see `Operator`."""

    maximum_tries = 1 + ROUNDS * RING

    def __init__(self, world: TabletopWorld, *, order: Order, rng: np.random.Generator) -> None:
        super().__init__(world, order=order, rng=rng)
        self._middle = self._aim.copy()
        self._around = AROUND[int(rng.integers(2))]
        self._tried = self._pressed = 0

    def _way(self) -> Array:
        start = self._world.start
        if isinstance(start, TightStart) and start.post_left_out:
            return np.array([self._position, self._hover()])
        return super()._way()

    def _corrected(self) -> Array:
        """The next point of the ring; behind a round those between the points."""
        turn = -1.0 if self._around == AROUND[0] else 1.0
        half = 0.5 * (self._tried // RING)
        angle = turn * 2.0 * np.pi * (self._tried + half) / RING
        self._tried += 1
        return self._middle + RING_M * np.array([np.cos(angle), np.sin(angle)])

    def _stands(self) -> bool:
        """It presses for a while: no blow, no bevel that lets go, and no wall of the hole."""
        pressed = super()._stands() and self._world.tip_depth_m < ENTERED_M
        self._pressed = self._pressed + 1 if pressed else 0
        return self._pressed > PRESSED_PERIODS

    def _align(self) -> Iterator[bool]:
        if self._tried:
            yield from self._wait(0.1)
        else:
            yield from super()._align()

    def _again(self) -> Iterator[bool]:
        """Off the rim, and over to the next point."""
        over_m = scene.FIXTURE_TOP_M + scene.TIP_OFFSET_M + LIFT_M
        yield from self._move(np.append(self._position[:2], over_m), speed_m_s=CREEP_M_S)
        yield from self._move(np.append(self._aim, over_m), speed_m_s=CREEP_M_S)
