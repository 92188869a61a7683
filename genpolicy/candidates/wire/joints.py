"""Joint positions that a policy commands, as poses of the TCP: by the robot's own kinematics.

The mapped action is a pose, and joints say more than it: which of the ways to reach a pose the arm
takes is decided by whoever executes, as for every other candidate.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from genpolicy.candidates.wire.channels import columns_of
from genpolicy.candidates.wire.entry import Joints, Output
from genpolicy.contract.observation import ObservationContract
from genpolicy.errors import ContractError
from genpolicy.robot.kinematics import ArmKinematics

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

RADIANS = {"rad": 1.0, "deg": np.pi / 180.0}
"""One of the unit in rad."""


class JointSpace:
    """What rows of joint numbers mean on a robot.

    Args:
        joints: Which columns they are.
        output: The rest of what the chunk's numbers mean.
        contract: The observation in force, which holds the anchor.
        scene: The MJCF that describes the robot; None where nobody knows it.

    Raises:
        ContractError: No robot, another number of joints than it has, or an anchor that the
            observation does not have, or not as joint positions.
    """

    def __init__(
        self, joints: Joints, output: Output, contract: ObservationContract, scene: Path | None
    ) -> None:
        if scene is None:
            raise ContractError(
                where="action.joints of the candidate",
                found="joint positions, and data of no registered task",
                expected="a task whose scene says what the robot is",
                action="Install the task of the data, or let the policy say poses of the TCP.",
            )
        self._arm = ArmKinematics(scene)
        _require_count("action.joints.columns", len(joints.columns), self._arm, scene)
        self._joints, self._motion = joints, output.motion
        self._anchor: tuple[Indices, Array] | None = None
        if output.anchor is not None:
            where, names = "action.anchor.joints", output.anchor.joints or []
            columns = columns_of(names, contract, where=where)
            _require_count(where, len(columns), self._arm, scene)
            self._anchor = columns, _radians(columns, contract, where)

    def poses(self, chunks: Array, conditioned_by: Array) -> tuple[Array, Array]:
        """Poses of the TCP in the base frame.

        Args:
            chunks: What the policy said. Shape (N, K, D).
            conditioned_by: Newest observation that it was given. Shape (D_o,).

        Returns:
            Positions, m, shape (N, K, 3), and rotations, shape (N, K, 3, 3).
        """
        q_rad = chunks[..., self._joints.columns] * RADIANS[self._joints.unit]
        if self._motion == "increments":
            q_rad = np.cumsum(q_rad, axis=1)
        if self._anchor is not None:
            columns, scale = self._anchor
            q_rad = q_rad + conditioned_by[columns] * scale
        return self._arm.forward(q_rad)


def _require_count(where: str, found: int, arm: ArmKinematics, scene: Path) -> None:
    if found != arm.joint_count:
        raise ContractError(
            where=f"{where} of the candidate",
            found=f"{found} joints",
            expected=f"{arm.joint_count}, as the arm of {scene.name} has",
            action="Name one column for each joint, from the base to the hand.",
        )


def _radians(columns: Indices, contract: ObservationContract, where: str) -> Array:
    """One of each number's unit in rad."""
    units = [channel.unit for channel in contract.channels for _ in channel.components]
    found = [units[column] for column in columns]
    if other := sorted(set(found) - set(RADIANS)):
        raise ContractError(
            where=f"{where} of the candidate",
            found=f"numbers in {', '.join(other)}",
            expected="joint positions, in rad or deg",
            action="Name the channel of the measured joint positions.",
        )
    return np.array([RADIANS[unit] for unit in found])
