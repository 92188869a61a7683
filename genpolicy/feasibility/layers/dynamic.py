"""The dynamic layer: period, rates of joints and TCP, torques, and the step from where the arm is.

Rates of commands are held against the part of the robot's limits that commands may use. The arm is
never quite where its last command is: it lags, it was pushed, it was held. What it needs to follow
from there is held against the robot's limits as its maker gives them; the part that commands leave
free is what there is to catch up with.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.action import ROTATION
from genpolicy.contract.rotation import angle_between, rotation_from_6d
from genpolicy.feasibility.batch import Batch, Margins
from genpolicy.feasibility.cell import Cell
from genpolicy.robot.dynamics import ArmDynamics

Array = NDArray[np.float64]

PERIOD_TOLERANCE_S = 1e-9
ROUNDING = 1e-6  # relative; a step that was limited to its limit must not fail by rounding
AGE_ROUNDING_S = 1e-9
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
    joint_torque          min over joints of limit - |torque of the commanded motion|, N m
    payload_torque        the same with the payload, at commands at which the hand holds it; inf
                          where it holds none
    measured_velocity     min over joints of limit - |q_1 - q_meas| / t, rad/s
    measured_acceleration min over joints of limit - |(q_1 - q_cmd) / T - dq_meas| / t, rad/s^2
    state_age             min of (allowed age - age of the measured state, that age), s
    controller_mode       0 where the controller is in the cell's mode, else -1
    ====================  =====================================================================

    Source:
        Backward differences D. They rest on given commands only: what is not known before the
        boundary is not assumed, and the margin is inf where there are too few points. q_1 is the
        first executable row, t the time from the measurement to the end of that row's period: in
        t the arm must have come from where it was to q_1, and from its velocity to that of the
        first step, whose mean lies as far before its end as dq_meas's before the measurement.
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
        **_torques(batch, cell),
        **_from_measured(batch, cell),
        "controller_mode": _mode(batch, cell),
    })  # fmt: skip


def _mode(batch: Batch, cell: Cell) -> Array:
    """0 where the controller is in the mode that the figures of this layer are true of, else -1."""
    wanted = [bool(c.controller_mode) and c.controller_mode == cell.controller_mode
              for c in batch.contexts]  # fmt: skip
    return np.where(wanted, 0.0, -1.0)


def _torques(batch: Batch, cell: Cell) -> dict[str, Array]:
    """Torques at every command with one known on either side; inf without any. Shapes (B,).

    A closed hand may be empty, so the arm must bear the motion with its payload and without.
    """
    q, period_s = batch.solved.q_rad, cell.action_period_s
    histories = [c.q_cmd_history for c in batch.contexts]
    before = _history(histories, q.shape[-1])[:, -1:]
    path = np.concatenate([before, batch.q_cmd_rad[:, None], q], axis=1)
    speed = (path[:, 2:] - path[:, :-2]) / (2 * period_s)
    acceleration = np.diff(path, n=2, axis=1) / period_s**2
    flat = [value.reshape(-1, q.shape[-1]) for value in (path[:, 1:-1], speed, acceleration)]
    unknown = np.array([not len(history) for history in histories])

    def left(dynamics: ArmDynamics) -> Array:
        torque = dynamics.torque(*flat).reshape(speed.shape)
        margin = np.min(cell.limits.torque_nm - np.abs(torque), axis=2)
        margin[unknown, 0] = np.inf
        return np.asarray(margin)

    loaded = np.full(speed.shape[:2], np.inf)
    if cell.payload is not None:
        held = batch.held(cell.settings.held_opening_m)[:, :-1]
        loaded = np.where(held, left(cell.loaded_dynamics), np.inf)
    return {"joint_torque": left(cell.dynamics).min(axis=1), "payload_torque": loaded.min(axis=1)}


def _from_measured(batch: Batch, cell: Cell) -> dict[str, Array]:
    """Margins of the first step, from where the arm was measured. Shapes (B,)."""
    limits, period_s = cell.limits, cell.action_period_s
    first, contexts = batch.solved.q_rad[:, 0], batch.contexts
    ends_s = [
        chunk.metadata.action_start_time_s + (context.first_index + 1) * period_s
        for chunk, context in zip(batch.projected, contexts, strict=True)
    ]
    time_s = np.array(ends_s) - [c.measured_at_s for c in contexts]
    time_s = np.where(time_s > 0, time_s, np.nan)[:, None]  # no time to get there: refused
    velocity = (first - np.stack([c.q_meas for c in contexts])) / time_s
    step = (first - batch.q_cmd_rad) / period_s
    known = np.array([c.dq_meas is not None for c in contexts])
    came = [s if c.dq_meas is None else c.dq_meas for s, c in zip(step, contexts, strict=True)]
    acceleration = (step - np.stack(came)) / time_s
    ages_s = np.array([c.now_s - c.measured_at_s for c in contexts])
    allowed_s = np.array([c.maximum_age_s for c in contexts])
    left = np.min(limits.acceleration_rad_s2 - np.abs(acceleration), axis=1)
    return {
        "measured_velocity": np.min(limits.velocity_rad_s - np.abs(velocity), axis=1),
        "measured_acceleration": np.where(known, left, np.inf),
        "state_age": np.minimum(allowed_s - ages_s, ages_s) + AGE_ROUNDING_S,
    }


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
