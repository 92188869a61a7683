"""What a chunk is checked against: the state of robot, scene and session at this moment."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.action import ACTION_DIM
from genpolicy.contract.chunk import frozen_array
from genpolicy.errors import ContractError, NonFiniteError
from genpolicy.robot.scene_state import SceneState

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Context:
    """State at the moment of the check; all times in s on one monotonic clock.

    Attributes:
        q_meas: Measured joint positions, rad. Shape (J,).
        q_cmd: Joint positions of the last command, rad; the motion begins here. Shape (J,).
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
            given is not assumed: acceleration needs one of them at the boundary, jerk two. (n, J).
        newest_accepted_observation_s: Observation under the newest chunk accepted so far; an
            older one behind it is out of order. None before the first.
        first_index: Rows before it are late and will never be executed; the boundary is there.
        dq_meas: Measured joint velocities, rad/s, over the period before `q_meas`; None where only
            one state was measured: then nothing is assumed of them. Shape (J,).
        state_time_s: When `q_meas` was measured; None: now.
        controller_mode: Mode that the controller is in; empty where it is not known.
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
    dq_meas: Array | None = None
    state_time_s: float | None = None
    controller_mode: str = ""

    def __post_init__(self) -> None:
        joints = np.size(self.q_cmd)
        history = np.asarray(self.q_cmd_history)
        if not history.size:
            history = np.zeros((0, joints))
            object.__setattr__(self, "q_cmd_history", history)
        shapes: dict[str, tuple[int, ...]] = {
            "q_meas": (joints,), "q_cmd": (joints,), "last_action": (ACTION_DIM,),
            "q_cmd_history": (len(history), joints),
        }  # fmt: skip
        if self.dq_meas is not None:
            shapes["dq_meas"] = (joints,)
        for name, expected in shapes.items():
            value = frozen_array(getattr(self, name))
            object.__setattr__(self, name, value)
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
        if not self.first_index >= 0:
            raise ContractError(
                where="Context.first_index",
                found=str(self.first_index),
                expected="at least 0",
                action="Count the late rows of the chunk from its first row.",
            )

    @property
    def measured_at_s(self) -> float:
        """When the joints were measured, s."""
        return self.now_s if self.state_time_s is None else self.state_time_s

    def rows(self, actions: int) -> slice:
        """Which rows of a chunk of that many actions are checked: all that are not late."""
        return slice(self.first_index, actions)
