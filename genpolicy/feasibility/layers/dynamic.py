"""The dynamic layer: period, joint velocity, acceleration and jerk, speed and turn of the TCP."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.action import ROTATION
from genpolicy.contract.rotation import angle_between, rotation_from_6d
from genpolicy.feasibility.batch import Batch, Margins
from genpolicy.feasibility.cell import Cell

Array = NDArray[np.float64]

PERIOD_TOLERANCE_S = 1e-9
ROUNDING = 1e-6  # relative; a step that was limited to its limit must not fail by rounding
JERK_HISTORY = 2  # commands before the last one that jerk rests on


def margins(batch: Batch, cell: Cell) -> Margins:
    """Margins of the rates, from the last commands on; T is the action period.

    ====================  =====================================================================
    action_period         1 ns - |T of the chunk - T of the controller|, s
    joint_velocity        min over joints of limit - |D q| / T, rad/s
    joint_acceleration    min over joints of limit - |D^2 q| / T^2, rad/s^2
    joint_jerk            min over joints of limit - |D^3 q| / T^3, rad/s^3
    tcp_speed             limit - |D p| / T, m/s
    tcp_turn              limit - angle of a step / T, rad/s
    ====================  =====================================================================

    Source:
        Backward differences D. They rest on given commands only: what is not known before the
        boundary is not assumed, and the margin is inf where there are too few points.
    """
    settings, period_s = cell.settings, cell.action_period_s
    off = np.array([abs(p.metadata.action_period_s - period_s) for p in batch.projected])
    speed = np.linalg.norm(batch.steps_m, axis=2) / period_s
    before = rotation_from_6d(batch.last_action[:, None, ROTATION])
    before = np.concatenate([before, batch.rotation[:, :-1]], axis=1)
    turn = angle_between(before, batch.rotation) / period_s
    return Margins({
        "action_period": PERIOD_TOLERANCE_S - off,
        **_joint_rates(batch, cell),
        "tcp_speed": settings.tcp_speed_limit_m_s * (1 + ROUNDING) - speed.max(axis=1),
        "tcp_turn": settings.tcp_turn_limit_rad_s * (1 + ROUNDING) - turn.max(axis=1),
    })  # fmt: skip


def _joint_rates(batch: Batch, cell: Cell) -> dict[str, Array]:
    limits, q = cell.usable_limits, batch.solved.q_rad
    bounds = {
        "joint_velocity": limits.velocity_rad_s,
        "joint_acceleration": limits.acceleration_rad_s2,
        "joint_jerk": limits.jerk_rad_s3,
    }
    histories = [c.q_cmd_history for c in batch.contexts]
    path = np.concatenate([_history(histories, q.shape[-1]), batch.q_cmd_rad[:, None], q], axis=1)
    known = np.array([min(len(s), JERK_HISTORY) for s in histories]) + 1 + q.shape[1]
    result = {}
    for order, (name, bound) in enumerate(bounds.items(), start=1):
        path = np.diff(path, axis=1) / cell.action_period_s
        # Differences that end at a row of the chunk and rest on given commands only.
        usable = np.minimum(known - order, q.shape[1])
        result[name] = np.full(len(path), np.inf)
        left = np.min(bound * (1 + ROUNDING) - np.abs(path), axis=2)
        for chunk, count in enumerate(usable):
            if count > 0:
                result[name][chunk] = left[chunk, -count:].min()
    return result


def _history(histories: Sequence[Array], joints: int) -> Array:
    """The commands before `q_cmd`, padded in front; padding is never used. Shape (B, 2, J)."""
    result = np.zeros((len(histories), JERK_HISTORY, joints))
    for chunk, history in enumerate(histories):
        last = history[-JERK_HISTORY:]
        if len(last):
            result[chunk, -len(last) :] = last
    return result
