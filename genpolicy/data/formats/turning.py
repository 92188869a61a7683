"""Observed rotations as numbers whose change a commanded turn may be.

A quaternion has no component that a turn moves by what it says. Its small turns from row to row,
added up, have: about the axes of the base, and about those of the tool. Whether the scalar part
stands first or last is not recorded: both are tried, and a wrong reading follows nothing.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from genpolicy.data.formats.contract import ChannelSource
from genpolicy.data.formats.quaternions import is_quaternion
from genpolicy.data.formats.sample import Sample

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

SCALAR_LAST, SCALAR_FIRST = (0, 1, 2, 3), (1, 2, 3, 0)


def turned(channels: Sequence[ChannelSource], sample: Sample) -> Array:
    """Added-up turns of every observed rotation, and angles that jump, unwrapped. Shape (n, D)."""
    parts: list[Array] = []
    for channel in channels:
        values = sample.selected(channel.columns) * channel.factor
        if channel.transform == "cos_sin":
            parts.append(_unwrapped(values, sample.number))
            continue
        for first in range(values.shape[1] - 3):
            four = values[:, first : first + 4]
            if is_quaternion(four):
                for order in (SCALAR_LAST, SCALAR_FIRST):
                    parts += added_turns(four[:, order], sample.number)
    return np.concatenate(parts, axis=1) if parts else np.zeros((len(sample.number), 0))


def added_turns(quaternion: Array, episode: Integers) -> tuple[Array, Array]:
    """Turns from row to row, added up in each episode, about the base's and the tool's axes.

    Args:
        quaternion: Scalar last; the sign means nothing. Shape (n, 4).
        episode: Which episode each row belongs to. Shape (n,).

    Returns:
        Rotation vectors, rad. Shapes (n, 3).
    """
    norm = np.linalg.norm(quaternion, axis=1)
    # A damaged row must not stop the reading of all others.
    sane = np.where((np.isfinite(norm) & (norm > 0.0))[:, None], quaternion, (0.0, 0.0, 0.0, 1.0))
    rotation = Rotation.from_quat(sane)
    before, after = rotation[:-1], rotation[1:]
    inside = (np.diff(episode) == 0)[:, None]
    base = np.where(inside, (after * before.inv()).as_rotvec(), 0.0)
    tool = np.where(inside, (before.inv() * after).as_rotvec(), 0.0)
    begin = np.zeros((1, 3))
    return (
        np.concatenate([begin, np.cumsum(base, axis=0)]),
        np.concatenate([begin, np.cumsum(tool, axis=0)]),
    )


def _unwrapped(values: Array, episode: Integers) -> Array:
    edges = np.flatnonzero(np.diff(episode)) + 1
    return np.concatenate([np.unwrap(part, axis=0) for part in np.split(values, edges)])
