"""Task phase from the measured state, with hysteresis so that noise makes no phase flicker."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from genpolicy.tasks.tabletop_insertion.scene import (
    FIXTURE_TOP_M,
    OPEN_OPENING_M,
    POST_X_M,
    TIP_OFFSET_M,
)

Array = NDArray[np.float64]

# approach <-> align: past the post and near the hole.
PAST_POST_M = 0.045
ALIGN_ENTER_M, ALIGN_LEAVE_M = 0.085, 0.110
# align <-> insert: over the hole, the tip close above the fixture.
INSERT_ENTER_M, INSERT_LEAVE_M = 0.008, 0.014
INSERT_ENTER_HEIGHT_M, INSERT_LEAVE_HEIGHT_M = 0.030, 0.045
# insert <-> release: how deep the tip is.
RELEASE_ENTER_DEPTH_M, RELEASE_LEAVE_DEPTH_M = 0.032, 0.024
# release -> retreat.
OPENED_M = 0.8 * OPEN_OPENING_M
# Any free phase -> recover: the TCP is this far from where it is commanded; and back.
RECOVER_ENTER_M, RECOVER_LEAVE_M = 0.018, 0.006
RECOVER_MINIMUM_S = 0.20


@dataclass(frozen=True)
class Measured:
    """What the phase is decided from.

    Attributes:
        tcp_m: TCP position, m. Shape (3,).
        hole_xy_m: Centre of the hole, m. Shape (2,).
        gripper_opening_m: Mean finger opening, m.
        holding: The object is in the grasp.
        deviation_m: Distance of the TCP from the commanded position, m.
        recovery_requested: Operator or supervisor asks for the recovery phase.
    """

    tcp_m: Array
    hole_xy_m: Array
    gripper_opening_m: float
    holding: bool
    deviation_m: float
    recovery_requested: bool


class PhaseLogic:
    """Remembers the phase; `update` moves it at most along the arrows of the task.

    approach <-> align <-> insert <-> release -> retreat; approach, align <-> recover.
    """

    def __init__(self) -> None:
        self.phase = "approach"
        self._recovering_s = 0.0

    def update(self, measured: Measured, *, period_s: float) -> str:
        """The phase after `period_s` more, given the state measured now."""
        if self.phase == "recover":
            self._recovering_s += period_s
        self.phase = self._next(measured)
        if self.phase != "recover":
            self._recovering_s = 0.0
        return self.phase

    def _next(self, measured: Measured) -> str:
        if not measured.holding:
            opening = self.phase in ("insert", "release")
            return "release" if opening and measured.gripper_opening_m < OPENED_M else "retreat"
        if self.phase == "recover" and not self._recovered(measured):
            return "recover"
        free = self.phase not in ("insert", "release")
        if free and (measured.recovery_requested or measured.deviation_m > RECOVER_ENTER_M):
            return "recover"
        return self._by_place(measured)

    def _recovered(self, measured: Measured) -> bool:
        return (
            not measured.recovery_requested
            and measured.deviation_m < RECOVER_LEAVE_M
            and self._recovering_s >= RECOVER_MINIMUM_S - 1e-9
        )

    def _by_place(self, measured: Measured) -> str:
        lateral = float(np.hypot(*(measured.tcp_m[:2] - measured.hole_xy_m)))
        height = float(measured.tcp_m[2]) - TIP_OFFSET_M - FIXTURE_TOP_M
        phase = self.phase
        if phase == "release" and height > -RELEASE_LEAVE_DEPTH_M:
            phase = "insert"
        if phase == "insert":
            if height < -RELEASE_ENTER_DEPTH_M:
                return "release"
            if height > INSERT_LEAVE_HEIGHT_M or (lateral > INSERT_LEAVE_M and height > -0.005):
                phase = "align"
            else:
                return "insert"
        if phase == "release":
            return "release"
        if lateral < INSERT_ENTER_M and height < INSERT_ENTER_HEIGHT_M:
            return "insert"
        if phase == "align":
            return "approach" if lateral > ALIGN_LEAVE_M else "align"
        past = float(measured.tcp_m[0]) > POST_X_M + PAST_POST_M
        return "align" if past and lateral < ALIGN_ENTER_M else "approach"
