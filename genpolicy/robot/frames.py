"""Frames of a placed arm, and what follows from them alone: the Jacobian, the way to a pose."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

TINY = 1e-12  # below it a norm is no length to divide by


@dataclass(frozen=True)
class Frames:
    """Placement of the J joint frames and the TCP in the base frame.

    Attributes:
        rotation: Joints 1 to J, then the TCP. Shape (N, J + 1, 3, 3).
        position_m: Shape (N, J + 1, 3).
    """

    rotation: Array
    position_m: Array


def jacobian_of(frames: Frames) -> Array:
    """Jacobian of the TCP: linear (m/rad) over angular rows. Shape (N, 6, J)."""
    axes = frames.rotation[:, :-1, :, 2]
    arms = frames.position_m[:, -1, None, :] - frames.position_m[:, :-1]
    jacobian = np.empty((len(axes), 6, axes.shape[1]))
    jacobian[:, 0] = axes[..., 1] * arms[..., 2] - axes[..., 2] * arms[..., 1]
    jacobian[:, 1] = axes[..., 2] * arms[..., 0] - axes[..., 0] * arms[..., 2]
    jacobian[:, 2] = axes[..., 0] * arms[..., 1] - axes[..., 1] * arms[..., 0]
    jacobian[:, 3:] = axes.transpose(0, 2, 1)
    return jacobian


def pose_error(frames: Frames, position_m: Array, rotation: Array) -> Array:
    """Position (m) and rotation vector (rad) from the frames to the poses. Shape (N, 6)."""
    error = np.empty((len(position_m), 6))
    error[:, :3] = position_m - frames.position_m[:, -1]
    relative = rotation @ frames.rotation[:, -1].transpose(0, 2, 1)
    vector = np.stack(
        [
            relative[:, 2, 1] - relative[:, 1, 2],
            relative[:, 0, 2] - relative[:, 2, 0],
            relative[:, 1, 0] - relative[:, 0, 1],
        ],
        axis=1,
    )
    double_sine = np.linalg.norm(vector, axis=1)
    angle = np.arctan2(double_sine, np.trace(relative, axis1=1, axis2=2) - 1.0)
    scale = np.where(double_sine > TINY, angle / np.maximum(double_sine, TINY), 0.5)
    error[:, 3:] = vector * scale[:, None]
    half_turn = (double_sine <= 1e-9) & (angle > 1.0)  # the axis is lost: push off it
    error[half_turn, 3:] = [0.5, 0.5, 0.5]
    return error
