"""Kinematics of the arm: Pinocchio's model of the scene file, evaluated for whole batches.

Pinocchio reads the MJCF and stays the reference. Forward kinematics and the Jacobian of many
configurations at once are numpy over the joint placements that Pinocchio holds (one call of the
library per configuration costs more than the arithmetic); tests hold the two, and MuJoCo,
together to 1e-9. Inverse kinematics is damped least squares.
"""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from genpolicy.errors import ConfigError
from genpolicy.robot.frames import TINY, Frames, jacobian_of, pose_error

Array = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

TCP_SITE = "tcp"  # MJCF convention: the site at the tool centre point
DAMPING = 1e-3
STEP_LIMIT_RAD = 0.5
ITERATIONS = 40
POSITION_TOLERANCE_M = 1e-7
ROTATION_TOLERANCE_RAD = 1e-7
# Ratio of the additive recurrence that spreads restart seeds; any irrational one does, and
# another one would move every restart.
RESTART_RATIO = 1.0889670195


@dataclass(frozen=True)
class IkResult:
    """Inverse kinematics of N poses.

    Attributes:
        q_rad: Last iterate, converged or not. Shape (N, J).
        converged: Both errors within tolerance. Shape (N,).
        position_error_m: Distance that is left; NaN where an input is not finite. Shape (N,).
        rotation_error_rad: Angle that is left. Shape (N,).
    """

    q_rad: Array
    converged: BoolArray
    position_error_m: Array
    rotation_error_rad: Array


class ArmKinematics:
    """A revolute arm with a TCP frame, built from an MJCF file.

    Args:
        scene_path: The MJCF; its first body tree is the arm.
        tcp_frame: Name of the TCP's site; the MJCF convention unless a scene has several.

    Attributes:
        joint_count: Joints between the base and the TCP.

    Raises:
        ConfigError: The frame is missing, or what leads to it is not z-axis revolute joints in a
            row.
    """

    def __init__(self, scene_path: Path, *, tcp_frame: str = TCP_SITE) -> None:
        self.scene_path = Path(scene_path)
        self.model: Any = _read_model(self.scene_path)
        self.data: Any = self.model.createData()
        self.tcp_frame = tcp_frame
        self.tcp_frame_id, self.joint_count = self._structure(tcp_frame)
        joints = self.joint_count
        placements = [self.model.jointPlacements[i + 1] for i in range(joints)]
        tcp = self.model.frames[self.tcp_frame_id].placement
        self._rotations = _frozen([np.array(p.rotation) for p in [*placements, tcp]])
        self._translations = _frozen([np.array(p.translation) for p in [*placements, tcp]])
        self.lower_rad = _frozen(self.model.lowerPositionLimit[:joints])
        self.upper_rad = _frozen(self.model.upperPositionLimit[:joints])

    def _structure(self, tcp_frame: str) -> tuple[int, int]:
        """Index of the TCP's frame, and how many joints lead to it."""
        model = self.model
        if not model.existFrame(tcp_frame):
            raise ConfigError(
                where=f"{self.scene_path.name}: frame {tcp_frame}",
                found="missing in the arm's tree",
                expected="a site of that name behind the last joint of the arm",
                action="Add the site to the hand.",
            )
        frame = int(model.getFrameId(tcp_frame))
        count = int(model.frames[frame].parentJoint)
        names = [model.joints[i].shortname() for i in range(1, count + 1)]
        chain = list(model.parents)[1 : count + 1]
        if not count or names != ["JointModelRZ"] * count or chain != list(range(count)):
            raise ConfigError(
                where=f"{self.scene_path.name}: joints to the frame {tcp_frame}",
                found=f"joints {names} with parents {chain}",
                expected="revolute joints about their own z axes, one behind the other",
                action="Describe the arm first in the MJCF, one z axis per joint.",
            )
        return frame, count

    @cached_property
    def reach_m(self) -> float:
        """No point within 0.25 m of the TCP is farther than this from any joint axis, m."""
        lengths = np.linalg.norm(self._translations[1:], axis=-1)
        return float(np.sum(lengths)) + 0.25

    def frames(self, q_rad: Array) -> Frames:
        """Placements of the joints and the TCP.

        Args:
            q_rad: Joint positions, rad. Shape (N, J).

        Returns:
            Frames of N configurations.

        Source:
            Product of the fixed joint placements and rotations about z.
        """
        n, joints = len(q_rad), self.joint_count
        rotation = np.empty((n, joints + 1, 3, 3))
        position = np.empty((n, joints + 1, 3))
        cosines, sines = np.cos(q_rad)[..., None], np.sin(q_rad)[..., None]
        position[:, 0] = self._translations[0]
        fixed = np.broadcast_to(self._rotations[0], (n, 3, 3))
        for joint in range(joints):
            if joint:
                previous = rotation[:, joint - 1]
                fixed = (previous.reshape(-1, 3) @ self._rotations[joint]).reshape(n, 3, 3)
                position[:, joint] = position[:, joint - 1] + previous @ self._translations[joint]
            c, s = cosines[:, joint], sines[:, joint]
            rotation[:, joint, :, 0] = fixed[:, :, 0] * c + fixed[:, :, 1] * s
            rotation[:, joint, :, 1] = fixed[:, :, 1] * c - fixed[:, :, 0] * s
            rotation[:, joint, :, 2] = fixed[:, :, 2]
        last = rotation[:, joints - 1]
        rotation[:, joints] = (last.reshape(-1, 3) @ self._rotations[joints]).reshape(n, 3, 3)
        position[:, joints] = position[:, joints - 1] + last @ self._translations[joints]
        return Frames(rotation, position)

    def forward(self, q_rad: Array) -> tuple[Array, Array]:
        """TCP position (m) and rotation in the base frame.

        Args:
            q_rad: Joint positions, rad. Shape (..., J).

        Returns:
            Position, shape (..., 3), and rotation matrix, shape (..., 3, 3).
        """
        shape = q_rad.shape[:-1]
        frames = self.frames(np.asarray(q_rad, dtype=float).reshape(-1, self.joint_count))
        return (
            frames.position_m[:, -1].reshape(*shape, 3),
            frames.rotation[:, -1].reshape(*shape, 3, 3),
        )

    def jacobian(self, q_rad: Array) -> Array:
        """Jacobian of the TCP: linear (m/rad) over angular rows, in axes of the base frame.

        Args:
            q_rad: Joint positions, rad. Shape (N, J).

        Returns:
            Shape (N, 6, J).
        """
        return jacobian_of(self.frames(q_rad))

    def condition_number(self, q_rad: Array) -> Array:
        """Largest over smallest singular value of the TCP Jacobian (m and rad mixed).

        Args:
            q_rad: Joint positions, rad. Shape (N, J).

        Returns:
            Shape (N,); inf at a singular configuration.

        Source:
            The measure of MoveIt Servo; its defaults are `CONDITION_SLOW` and
            `CONDITION_HARD_STOP` above.
        """
        jacobian = self.jacobian(q_rad)
        finite = np.all(np.isfinite(jacobian), axis=(1, 2))
        gram = np.where(finite[:, None, None], jacobian @ jacobian.transpose(0, 2, 1), np.eye(6))
        values = np.linalg.eigvalsh(gram)
        smallest = np.maximum(values[:, 0], 0.0)
        with np.errstate(divide="ignore"):
            condition = np.sqrt(values[:, -1] / smallest)
        return np.where(finite, condition, np.nan)

    def solve(
        self, position_m: Array, rotation: Array, *, q_seed_rad: Array, iterations: int = ITERATIONS
    ) -> IkResult:
        """Joint positions that reach N poses, each from its own seed.

        Every row is solved on its own, so the answer does not depend on the batch. Minimum-norm
        steps keep a redundant arm close to its seed.

        Args:
            position_m: TCP positions, m. Shape (N, 3).
            rotation: TCP rotations. Shape (N, 3, 3).
            q_seed_rad: Where to start. Shape (N, J).
            iterations: Most Newton steps.

        Returns:
            One row per pose; rows with non-finite input never converge.

        Source:
            Damped least squares (Wampler 1986; Nakamura and Hanafusa 1986), constant damping.
        """
        q = np.array(q_seed_rad, dtype=float)
        n = len(q)
        position_error, rotation_error = np.full(n, np.nan), np.full(n, np.nan)
        finite = np.isfinite(position_m).all(1) & np.isfinite(rotation).all((1, 2))
        active = np.flatnonzero(finite & np.isfinite(q).all(1))
        for iteration in range(iterations + 1):
            frames = self.frames(q[active])
            error = pose_error(frames, position_m[active], rotation[active])
            position_error[active] = np.linalg.norm(error[:, :3], axis=1)
            rotation_error[active] = np.linalg.norm(error[:, 3:], axis=1)
            left = ~_within(position_error[active], rotation_error[active])
            if iteration == iterations or not left.any():
                break
            active = active[left]
            q[active] += _step(jacobian_of(frames)[left], error[left])
        return IkResult(q, _within(position_error, rotation_error), position_error, rotation_error)

    def solve_with_restarts(
        self, position_m: Array, rotation: Array, *, q_seed_rad: Array, restarts: int = 16
    ) -> IkResult:
        """`solve`, then for rows that failed or left the joint limits fixed other seeds.

        The seeds are the same in every call, so the answer is deterministic. Of several
        solutions within the position limits the one closest to the row's own seed is taken.
        """
        result = self.solve(position_m, rotation, q_seed_rad=q_seed_rad)
        good = result.converged & self.within_limits(result.q_rad)
        failed = np.flatnonzero(~good & np.isfinite(result.position_error_m))
        if not len(failed) or restarts <= 0:
            return result
        seeds = self._restart_seeds(restarts)
        again = self.solve(
            np.repeat(position_m[failed], restarts, axis=0),
            np.repeat(rotation[failed], restarts, axis=0),
            q_seed_rad=np.tile(seeds, (len(failed), 1)),
        )
        q_again = self._wrapped(again.q_rad)
        usable = (again.converged & self.within_limits(q_again)).reshape(-1, restarts)
        q_again = q_again.reshape(-1, restarts, self.joint_count)
        distance = np.linalg.norm(q_again - q_seed_rad[failed][:, None], axis=2)
        best = np.argmin(np.where(usable, distance, np.inf), axis=1)
        found = usable.any(1)
        rows, chosen = failed[found], best[found] + np.flatnonzero(found) * restarts
        q = result.q_rad.copy()
        position_error, rotation_error = (
            result.position_error_m.copy(),
            result.rotation_error_rad.copy(),
        )
        q[rows] = q_again.reshape(-1, self.joint_count)[chosen]
        position_error[rows] = again.position_error_m[chosen]
        rotation_error[rows] = again.rotation_error_rad[chosen]
        return IkResult(q, _within(position_error, rotation_error), position_error, rotation_error)

    def within_limits(self, q_rad: Array) -> BoolArray:
        """Whether every joint is inside the position limits of the MJCF. Shape (...)."""
        inside: BoolArray = np.all((q_rad >= self.lower_rad) & (q_rad <= self.upper_rad), axis=-1)
        return inside

    def _wrapped(self, q_rad: Array) -> Array:
        """The same configurations with each joint shifted by whole turns towards its range."""
        middle = (self.lower_rad + self.upper_rad) / 2
        return q_rad - 2 * np.pi * np.round((q_rad - middle) / (2 * np.pi))

    def _restart_seeds(self, count: int) -> Array:
        """Fixed, well spread seeds inside the limits: an additive recurrence. Shape (count, J)."""
        steps = (1 / RESTART_RATIO) ** np.arange(1, self.joint_count + 1)
        fractions = np.mod(0.5 + np.outer(np.arange(1, count + 1), steps), 1.0)
        return self.lower_rad + fractions * (self.upper_rad - self.lower_rad)


def _read_model(scene_path: Path) -> Any:
    try:
        return pin.buildModelFromMJCF(str(scene_path))
    except (ValueError, RuntimeError) as error:
        raise ConfigError(
            where=scene_path.name,
            found=f"refused by Pinocchio: {str(error).strip().splitlines()[-1]}",
            expected="an MJCF whose first body tree is the arm",
            action="Correct the scene file.",
        ) from error


def _frozen(values: Any) -> Array:
    array = np.array(values, dtype=float)
    array.flags.writeable = False
    return array


def _step(jacobian: Array, error: Array) -> Array:
    transposed = jacobian.transpose(0, 2, 1)
    gram = jacobian @ transposed + DAMPING**2 * np.eye(6)
    step: Array = (transposed @ np.linalg.solve(gram, error[..., None]))[..., 0]
    largest = np.max(np.abs(step), axis=1, keepdims=True)
    step *= np.minimum(1.0, STEP_LIMIT_RAD / np.maximum(largest, TINY))
    return step


def _within(position_error_m: Array, rotation_error_rad: Array) -> BoolArray:
    within: BoolArray = (position_error_m <= POSITION_TOLERANCE_M) & (
        rotation_error_rad <= ROTATION_TOLERANCE_RAD
    )
    return within
