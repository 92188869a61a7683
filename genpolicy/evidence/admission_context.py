"""What feasibility must know of a moment: scene from the observation, commands in joint space."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.chunk import ChunkMetadata, Proposal
from genpolicy.feasibility.admission import FeasibilityChecker
from genpolicy.feasibility.context import Context
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.robot.scene_state import SceneState
from genpolicy.tasks.api import Task

Array = NDArray[np.float64]

RECORDED = "recorded"

COMMANDS_AT_THE_SEAM = 3
"""Acceleration at the seam needs one command before the last one, jerk two."""


@dataclass(frozen=True)
class Session:
    """What is in force while a chunk is checked.

    Attributes:
        calibration_epoch: Active calibration.
        session_epoch: Active session.
        checkpoint: Weights in force.
        sampler: Sampler settings in force.
        maximum_age_s: Oldest observation that may still be acted on, by phase.
    """

    calibration_epoch: str
    session_epoch: int
    checkpoint: str
    sampler: str
    maximum_age_s: dict[str, float]


def make_checker(
    task: Task, settings: FeasibilitySettings, *, disabled_checks: frozenset[str] = frozenset()
) -> FeasibilityChecker:
    """The six layers for a task; `disabled_checks` only for the evidence on mutants."""
    return FeasibilityChecker(
        task.scene_path,
        workspace=task.workspace,
        settings=settings,
        disabled_checks=disabled_checks,
    )


def seam(
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


def context_of(
    task: Task,
    checker: FeasibilityChecker,
    *,
    observation: Array,
    q_meas: Array,
    commanded: Sequence[Array],
    now_s: float,
    phase: str,
    latest_observation_s: float,
    session: Session,
    first_index: int,
    end_index: int | None,
    newest_accepted_observation_s: float | None = None,
) -> Context:
    """Context of a check at `now_s`; see `genpolicy.feasibility.context.Context`."""
    q_cmd, history = seam(checker, commanded[-COMMANDS_AT_THE_SEAM:], q_meas)
    return Context(
        q_meas=q_meas,
        q_cmd=q_cmd,
        last_action=commanded[-1],
        now_s=now_s,
        phase=phase,
        calibration_epoch=session.calibration_epoch,
        session_epoch=session.session_epoch,
        latest_observation_event_time_s=latest_observation_s,
        maximum_age_s=session.maximum_age_s[phase],
        active_checkpoint_hash=session.checkpoint,
        active_sampler_hash=session.sampler,
        scene=SceneState(task.scene_poses(observation)),
        q_cmd_history=history,
        newest_accepted_observation_s=newest_accepted_observation_s,
        first_index=first_index,
        end_index=end_index,
    )


def context_at_rest(
    task: Task,
    checker: FeasibilityChecker,
    observation: Array,
    *,
    execution_horizon: int | None,
) -> Context:
    """Context of a recorded observation, for chunks that begin at it.

    Where the robot stands follows from the observed TCP pose; commands before it are not
    assumed, so that the seam is judged by speed alone. The chunk begins at the observation: its
    age is 0, and 0 is what it may be.

    Args:
        task: The task.
        checker: Does the inverse kinematics.
        observation: Newest observation. Shape (D_o,).
        execution_horizon: Rows that would be executed; None checks the whole chunk.
    """
    action = task.action_at(observation)
    phase = task.phase_of(observation)
    q, _ = checker.ik_chunk(action[None], task.posture_rad)
    return context_of(
        task,
        checker,
        observation=observation,
        q_meas=q[0],
        commanded=[action],
        now_s=0.0,
        phase=phase,
        latest_observation_s=0.0,
        session=Session(RECORDED, 0, RECORDED, RECORDED, {phase: 0.0}),
        first_index=0,
        end_index=execution_horizon,
    )


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
