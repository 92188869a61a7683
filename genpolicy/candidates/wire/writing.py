"""From mapped actions to a policy's own form: what a prefix is written in for it.

The inverse of `mapping`, where there is one. A rotation has several names in some forms: written is
the quaternion with w >= 0 and the shortest rotation vector.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation as Turn

from genpolicy.candidates.wire.entry import LENGTH, Output
from genpolicy.contract.action import ROTATION, split_action
from genpolicy.contract.rotation import rotation_to_6d
from genpolicy.errors import ContractError

Array = NDArray[np.float64]
Pose = tuple[Array, Array]
"""Position (3,), m, and rotation (3, 3)."""


def not_writable(output: Output) -> str:
    """Why mapped actions cannot be said in this form; empty where they can."""
    if output.joints is not None:
        return "joints: which of the ways to a pose the arm shall take, a pose does not say"
    if output.rotation is None:
        return "no rotation: how the given actions are turned would be lost"
    return ""


def written(output: Output, actions: Array, anchor: Pose | None) -> Array:
    """Mapped actions as the policy itself would say them.

    Args:
        output: Its form.
        actions: Mapped actions; each is a pose. Shape (K, 10).
        anchor: What relative motions start from; None of absolute ones.

    Returns:
        Shape (K, D); columns without a meaning are 0.

    Raises:
        ContractError: A form in which a mapped action cannot be said.
    """
    position, rotation = output.position, output.rotation
    if position is None or rotation is None:
        raise ContractError(
            where="action of the candidate",
            found=not_writable(output),
            expected="position and rotation, in which given actions can be said",
            action="Add it to `stress.joining.exempt`, or choose another rule.",
        )
    place, turned, opened = split_action(actions)
    if anchor is not None:
        place, turned = _from(anchor, place, turned, output)
    said = np.zeros((len(actions), output.width))
    said[:, position.columns] = place / LENGTH[position.unit]
    as_predicted = rotation.form == "rotation_6d" and anchor is None
    said[:, rotation.columns] = (
        actions[:, ROTATION] if as_predicted else numbers(rotation.form, turned)
    )
    gripper = output.gripper
    share = opened / gripper.open_m
    said[:, gripper.column] = gripper.closed + share * (gripper.open - gripper.closed)
    return said


def numbers(form: str, matrices: Array) -> Array:
    """Numbers (K, n) of a form, of rotation matrices (K, 3, 3)."""
    if form == "rotation_6d":
        return rotation_to_6d(matrices)
    if form == "matrix":
        return matrices.reshape(-1, 9)
    turn = Turn.from_matrix(matrices)
    if form.startswith("quaternion"):
        quaternion: Array = turn.as_quat(canonical=True)
        return quaternion if form == "quaternion_xyzw" else np.roll(quaternion, 1, axis=1)
    said: Array = (
        turn.as_rotvec()
        if form == "rotation_vector_rad"
        else turn.as_euler("xyz", degrees=form.endswith("deg"))
    )
    return said


def _from(anchor: Pose, place: Array, turned: Array, output: Output) -> Pose:
    """How each pose is reached from the anchor, or where each counts from, from the one before."""
    before, faced = (np.broadcast_to(part, (len(place), *part.shape)) for part in anchor)
    if output.motion == "increments":
        before = np.concatenate([before[:1], place[:-1]])
        faced = np.concatenate([faced[:1], turned[:-1]])
    back = np.swapaxes(faced, 1, 2)
    step = place - before
    if output.frame == "tcp":
        return np.einsum("kij,kj->ki", back, step), back @ turned
    return step, turned @ back
