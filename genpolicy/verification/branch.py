"""How far joints turn from one row to the next for no motion of the tool, by MuJoCo alone."""

from collections.abc import Iterator
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from genpolicy.verification.contact import ROUNDING

Array = NDArray[np.float64]
Finding = tuple[str, str]


def jumped(model: Any, data: Any, site: int, ends: Array, limit_rad: float) -> Iterator[Finding]:
    """Whether the joints come to a row (2, J) by a motion of the TCP, and not by a jump."""
    if np.max(np.abs(ends[1] - ends[0])) > limit_rad:
        strayed = strayed_rad(model, data, site, ends)
        if not strayed <= limit_rad * (1 + ROUNDING):
            yield "P6.branch", f"A joint turns {strayed:.3g} rad that its pose asks for nowhere."


def strayed_rad(model: Any, data: Any, site: int, ends: Array) -> float:
    """Largest turn of a joint beyond the smallest joint step that moves a site as it moved, rad.

    The poses that `data` holds are overwritten.

    Args:
        model: MuJoCo's model; the arm's joints come first.
        data: Its data.
        site: Number of the site.
        ends: Joint positions at both ends, rad. Shape (2, J).
    """
    joints = ends.shape[1]
    places, turns = np.zeros((2, 3)), np.zeros((2, 4))
    for end, q_rad in enumerate(ends):
        data.qpos[:joints] = q_rad
        mujoco.mj_kinematics(model, data)
        places[end] = data.site_xpos[site]
        mujoco.mju_mat2Quat(turns[end], data.site_xmat[site])
    own, way = np.zeros(3), np.zeros(6)
    mujoco.mju_subQuat(own, turns[1], turns[0])  # about the axes of the site, as it began
    mujoco.mju_rotVecQuat(way[3:], own, turns[0])
    way[:3] = places[1] - places[0]
    data.qpos[:joints] = ends.mean(axis=0)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    jacobian = np.zeros((6, model.nv))
    mujoco.mj_jacSite(model, data, jacobian[:3], jacobian[3:], site)
    least, *_ = np.linalg.lstsq(jacobian[:, :joints], way, rcond=None)
    return float(np.max(np.abs(ends[1] - ends[0] - least)))
