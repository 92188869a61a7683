"""What feasibility must know of a moment: scene from the observation, commands in joint space.

Which rows are checked is one rule, everywhere: all from the first that is not late to the end of
the chunk, also those behind the execution horizon, which no controller will see (decision 16).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.chunk import ChunkMetadata, Proposal
from genpolicy.feasibility.admission import FeasibilityChecker
from genpolicy.feasibility.cell import cell_of
from genpolicy.feasibility.checks import CHECKS, Check
from genpolicy.feasibility.context import Context
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.robot.scene_state import SceneState
from genpolicy.tasks.api import Task

Array = NDArray[np.float64]

RECORDED = "recorded"

COMMANDS_AT_THE_BOUNDARY = 3
"""Acceleration at the boundary needs one command before the last one, jerk two."""


@dataclass(frozen=True)
class Session:
    """What is in force while a chunk is checked.

    Attributes:
        calibration_epoch: Active calibration.
        session_epoch: Active session.
        checkpoint: Weights in force.
        sampler: Sampler settings in force.
        maximum_age_s: Oldest observation that may still be acted on, by phase.
        controller_mode: Mode that the controller is in.
    """

    calibration_epoch: str
    session_epoch: int
    checkpoint: str
    sampler: str
    maximum_age_s: dict[str, float]
    controller_mode: str


def make_checker(
    task: Task,
    settings: FeasibilitySettings,
    *,
    action_period_s: float,
    checks: tuple[Check, ...] = CHECKS,
) -> FeasibilityChecker:
    """The six layers for a task.

    Args:
        task: Scene, workspace, robot and phases.
        settings: Thresholds.
        action_period_s: The controller's period, s.
        checks: Rows of the table; a part of it only for the evidence on mutants.
    """
    cell = cell_of(task, settings, action_period_s=action_period_s)
    return FeasibilityChecker(cell, checks=checks)


def commands_in_joints(
    checker: FeasibilityChecker, commanded: Sequence[Array], q_near: Array
) -> tuple[Array, Array]:
    """Joint positions of the last command and of those before it.

    Args:
        checker: Does the inverse kinematics.
        commanded: The last commanded actions, oldest first, at least one. Shape (10,) each.
        q_near: Measured joint positions, rad. Shape (7,).

    Returns:
        `q_cmd` (7,) and `q_cmd_history` (n, 7), rad.
    """
    q, _ = checker.ik_chunk(np.stack(commanded), q_near)
    return q[-1], q[:-1]


@dataclass(frozen=True)
class Moment:
    """Where robot and scene stand when a chunk is checked.

    Attributes:
        observation: Newest observation, received now. Shape (D_o,).
        q_meas: Measured joint positions, rad. Shape (J,).
        commanded: Commanded actions, oldest first, at least one. Shape (10,) each.
        now_s: Now, s.
        phase: Active task phase.
        q_before: Joint positions measured one period before `q_meas`, rad; None where the arm was
            measured once. Shape (J,).
        measured_at_s: When `q_meas` was measured, s; None: now.
    """

    observation: Array
    q_meas: Array
    commanded: Sequence[Array]
    now_s: float
    phase: str
    q_before: Array | None = None
    measured_at_s: float | None = None

    def velocity(self, period_s: float) -> Array | None:
        """Measured joint velocities over the period before, rad/s; None if unknown. (J,)."""
        return None if self.q_before is None else (self.q_meas - self.q_before) / period_s


def context_of(
    task: Task,
    checker: FeasibilityChecker,
    moment: Moment,
    *,
    session: Session,
    late_rows: int = 0,
    newest_accepted_observation_s: float | None = None,
) -> Context:
    """Context of a check; see `genpolicy.feasibility.context.Context`.

    Args:
        task: Says where the scene stands.
        checker: Does the inverse kinematics.
        moment: Robot and scene.
        session: What is in force.
        late_rows: Rows that are late and will never be executed; all behind them are checked.
        newest_accepted_observation_s: Observation under the newest chunk accepted so far, s.
    """
    q_cmd, history = commands_in_joints(
        checker, moment.commanded[-COMMANDS_AT_THE_BOUNDARY:], moment.q_meas
    )
    return Context(
        q_meas=moment.q_meas,
        q_cmd=q_cmd,
        last_action=moment.commanded[-1],
        now_s=moment.now_s,
        phase=moment.phase,
        calibration_epoch=session.calibration_epoch,
        session_epoch=session.session_epoch,
        latest_observation_event_time_s=moment.now_s,
        maximum_age_s=session.maximum_age_s[moment.phase],
        active_checkpoint_hash=session.checkpoint,
        active_sampler_hash=session.sampler,
        # A task may hand out views of what it goes on writing to; the seal is on these numbers.
        scene=SceneState(
            {
                name: (np.array(position), np.array(quaternion))
                for name, (position, quaternion) in task.scene_poses(moment.observation).items()
            }
        ),
        q_cmd_history=history,
        newest_accepted_observation_s=newest_accepted_observation_s,
        first_index=late_rows,
        dq_meas=moment.velocity(checker.cell.action_period_s),
        state_time_s=moment.measured_at_s,
        controller_mode=session.controller_mode,
    )


def context_at_rest(task: Task, checker: FeasibilityChecker, observation: Array) -> Context:
    """Context of a recorded observation, for chunks that begin at it.

    Where the robot stands follows from the observed TCP pose; commands before it are not
    assumed, so that the boundary is judged by speed alone. The chunk begins at the observation: its
    age is 0, and 0 is what it may be.

    Args:
        task: The task.
        checker: Does the inverse kinematics.
        observation: Newest observation. Shape (D_o,).
    """
    action, phase = task.action_at(observation), task.phase_of(observation)
    q, _ = checker.ik_chunk(action[None], task.posture_rad)
    moment = Moment(observation, q[0], [action], now_s=0.0, phase=phase)
    mode = checker.cell.controller_mode  # recordings are of the controller that they are for
    session = Session(RECORDED, 0, RECORDED, RECORDED, {phase: 0.0}, mode)
    return context_of(task, checker, moment, session=session)


def recorded_proposal(
    task: Task, actions: Array, observation: Array, *, action_period_s: float, chunk_id: str
) -> Proposal:
    """A chunk that begins at a recorded observation, fresh by construction."""
    metadata = ChunkMetadata(
        chunk_id=chunk_id,
        condition_observation_event_time_s=0.0,
        policy_checkpoint_hash=RECORDED,
        sampler_config_hash=RECORDED,
        action_start_time_s=0.0,
        action_period_s=action_period_s,
        valid_until_s=len(actions) * action_period_s,
        task_phase=task.phase_of(observation),
        calibration_epoch=RECORDED,
        predecessor_chunk_id="",
        session_epoch=0,
        method=RECORDED,
        candidate_index=0,
    )
    return Proposal(metadata, actions, selected_by=RECORDED)


def admissible(
    task: Task,
    checker: FeasibilityChecker,
    actions: Array,
    observation: Array,
    *,
    action_period_s: float,
) -> tuple[bool, str]:
    """Whether a whole chunk (K, D_a) passes all six layers at a recorded observation, and why not.

    Returns:
        The verdict, and `layer: reason` where it is a no.
    """
    context = context_at_rest(task, checker, observation)
    proposal = recorded_proposal(
        task, actions, observation, action_period_s=action_period_s, chunk_id="recorded"
    )
    verdict = checker.check(checker.project(proposal, context=context), context=context)
    reason = f"{verdict.first_layer}: {verdict.first_reason}" if not verdict.passed else ""
    return verdict.passed, reason
