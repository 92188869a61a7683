"""What a chunk is checked against: the state of robot, scene and session at this moment."""

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.action import ACTION_DIM
from genpolicy.contract.chunk import frozen_array
from genpolicy.errors import ContractError, NonFiniteError
from genpolicy.robot.scene_state import SceneState

Array = NDArray[np.float64]


class Workspace(Protocol):
    """Box that the TCP may not leave; base frame."""

    @property
    def lower_m(self) -> tuple[float, float, float]:
        """Lowest x, y, z, m."""
        ...

    @property
    def upper_m(self) -> tuple[float, float, float]:
        """Highest x, y, z, m."""
        ...


@dataclass(frozen=True)
class Context:
    """State at the moment of the check; all times in s on one monotonic clock.

    Attributes:
        q_meas: Measured joint positions, rad. Shape (7,).
        q_cmd: Joint positions of the last command, rad; the motion begins here. Shape (7,).
        last_action: Action commanded last. Shape (D_a,).
        now_s: Now.
        phase: Active task phase.
        calibration_epoch: Active calibration.
        session_epoch: Active session.
        latest_observation_event_time_s: Event time of the newest observation received; a chunk
            cannot rest on a newer one.
        maximum_age_s: Oldest observation that may still be acted on in this phase.
        active_checkpoint_hash: Weights in force.
        active_sampler_hash: Sampler settings in force.
        scene: Where the movable bodies of the scene stand.
        q_cmd_history: Commands before `q_cmd`, oldest first, one period apart, rad; what is not
            given is not assumed: acceleration needs one of them at the seam, jerk two. (n, 7).
        newest_accepted_observation_s: Observation under the newest chunk accepted so far; an
            older one behind it is out of order. None before the first.
        first_index: Rows before it are late and will never be executed; the seam is there.
        end_index: Rows from here on will never be executed (execution horizon); None: all.
    """

    q_meas: Array
    q_cmd: Array
    last_action: Array
    now_s: float
    phase: str
    calibration_epoch: str
    session_epoch: int
    latest_observation_event_time_s: float
    maximum_age_s: float
    active_checkpoint_hash: str
    active_sampler_hash: str
    scene: SceneState
    q_cmd_history: Array = field(default_factory=lambda: np.zeros((0, 0)))
    newest_accepted_observation_s: float | None = None
    first_index: int = 0
    end_index: int | None = None

    def __post_init__(self) -> None:
        joints = np.size(self.q_cmd)
        if not len(self.q_cmd_history):
            object.__setattr__(self, "q_cmd_history", np.zeros((0, joints)))
        shapes = {"q_meas": (joints,), "q_cmd": (joints,), "last_action": (ACTION_DIM,)}
        for name in (*shapes, "q_cmd_history"):
            value = frozen_array(getattr(self, name))
            object.__setattr__(self, name, value)
            expected = shapes.get(name, (len(value), joints))
            if value.shape != expected:
                raise ContractError(
                    where=f"Context.{name}",
                    found=f"of shape {value.shape}",
                    expected=f"{expected}",
                    action="Hold; deliver the state of the robot.",
                )
            if not np.all(np.isfinite(value)):
                raise NonFiniteError(
                    where=f"Context.{name}",
                    found="holding NaN or infinity",
                    expected="finite numbers",
                    action="Hold; the state of the robot is unknown.",
                )
        if self.first_index < 0 or (
            self.end_index is not None and self.end_index <= self.first_index
        ):
            raise ContractError(
                where="Context.first_index and end_index",
                found=f"{self.first_index} and {self.end_index}",
                expected="0 <= first_index < end_index",
                action="Discard the chunk: no row of it can be executed.",
            )

    def rows(self, actions: int) -> slice:
        """Which rows of a chunk of that many actions can be executed, and are checked."""
        end = actions if self.end_index is None else min(self.end_index, actions)
        return slice(self.first_index, end)
