"""What a command may do with a held object, proved from the commands themselves.

In a contact phase the hand that holds on comes straight down and slowly; where it lets go, the
phase is one for that, or the object is already in the target.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Finding = tuple[str, str]

ROUNDING = 1e-6  # relative: a step that was limited to its limit is within it
DEPTH_TOLERANCE_M = 1e-5  # what a pose that was executed may be off the pose that was judged


@dataclass(frozen=True)
class ExpectedContact:
    """What touching the target must keep to, as the caller knows it.

    Attributes:
        phases: Phases in which the held object may touch the target.
        opening_phases: Phases in which the hand may let go wherever it is.
        force_n: What a command may press the object into the target with, by phase.
        stiffness_n_m: Force of the controller per way that is missing.
        speed_m_s: What the TCP may do while the hand holds on in such a phase.
        cone_rad: Half angle, about straight down, that it may come from.
        forgiven_m: Sideways or upward part of one step that the cone forgives.
        release_depth_m: Depth in the target from which on the hand may let go there.
    """

    phases: frozenset[str]
    opening_phases: frozenset[str]
    force_n: Mapping[str, float]
    stiffness_n_m: float
    speed_m_s: float
    cone_rad: float
    forgiven_m: float
    release_depth_m: float

    def coming(self, step_m: Array, period_s: float) -> Iterator[Finding]:
        """What is wrong with a step (3,) of a hand that holds on in a contact phase."""
        aside, rise = float(np.linalg.norm(step_m[:2])), float(step_m[2])
        allowed = self.forgiven_m + math.tan(self.cone_rad) * max(-rise, 0.0)
        if not aside <= allowed + ROUNDING * self.forgiven_m:
            yield "P6.approach", f"It goes {aside:.3g} m aside, allowed are {allowed:.3g} m."
        if not rise <= self.forgiven_m * (1 + ROUNDING):
            yield "P6.approach", f"It goes {rise:.3g} m up while it holds on."
        speed = float(np.linalg.norm(step_m)) / period_s
        if not speed <= self.speed_m_s * (1 + ROUNDING):
            yield "P6.contact_speed", f"What is held comes at {speed:.4g} m/s."

    def letting_go(self, phase: str, depth_m: float) -> Iterator[Finding]:
        """What is wrong with opening the hand, the object this deep in the target."""
        deep = phase in self.phases and depth_m >= self.release_depth_m - DEPTH_TOLERANCE_M
        if phase not in self.opening_phases and not deep:
            yield "P6.release", f"The hand lets go in phase {phase!r}, {depth_m:.3g} m deep."
