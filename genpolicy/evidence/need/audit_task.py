"""The audit of a task's dataset: feasibility and replay come from the task itself."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from genpolicy.audit.documents import Obstacle
from genpolicy.audit.run import AuditResult, audit
from genpolicy.audit.settings import AuditSettings
from genpolicy.audit.view import from_dataset
from genpolicy.contract.horizons import HorizonConfig
from genpolicy.data.dataset import Dataset, load_dataset
from genpolicy.data.recording.episode import PHASE_STREAM
from genpolicy.errors import ConfigError
from genpolicy.evidence.admission_context import admissible, make_checker
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.robot.collision import CollisionModel
from genpolicy.robot.kinematics import ArmKinematics
from genpolicy.tasks.api import Task, load_task

Array = NDArray[np.float64]


def audit_task(
    dataset: Path,
    *,
    task_name: str,
    settings: AuditSettings,
    feasibility: FeasibilitySettings,
    action_period_s: float,
    root_seed: int,
) -> AuditResult:
    """Audit the dataset of a registered task.

    Args:
        dataset: Folder of the dataset.
        task_name: Registered name.
        settings: What counts as near, as two modes, as red; from `settings_of`.
        feasibility: Thresholds of the six layers.
        action_period_s: Time between actions, s.
        root_seed: Root seed.
    """
    task = load_task(task_name)
    data = load_dataset(dataset)
    checker = make_checker(task, feasibility, action_period_s=action_period_s)

    def is_admissible(actions: Array, observation: Array) -> tuple[bool, str]:
        return admissible(
            task,
            checker,
            actions,
            observation,
            action_period_s=action_period_s,
        )

    return audit(
        from_dataset(data, contract=task.observation, settings=settings, period_s=action_period_s),
        settings,
        admissible=is_admissible,
        replay=lambda uuid: replay_episode(task, data, uuid),
        root_seed=root_seed,
    )


def settings_of(
    settings: AuditSettings, task: Task, horizons: HorizonConfig, *, confidence: float
) -> AuditSettings:
    """Settings with what the ladder shares, and the task's own channels where none are named.

    Args:
        settings: The audit's own; those with a home elsewhere are left out.
        task: Whose channels are read.
        horizons: Of the chunks that are trained, and so of those that are audited.
        confidence: Coverage of every interval.

    Raises:
        ConfigError: Something shared stands among the settings as well.
    """
    shared: dict[str, tuple[str, object]] = {
        "observation_horizon": ("horizons", horizons.observation_horizon),
        "chunk_rows": ("horizons", horizons.prediction_horizon),
        "confidence": ("confidence", confidence),
    }
    twice = sorted(set(shared) & settings.model_fields_set)
    if twice:
        home = shared[twice[0]][0]
        raise ConfigError(
            where=f"audit.{twice[0]}",
            found=f"{getattr(settings, twice[0])}",
            expected=f"nothing: `{home}` says it for the whole ladder",
            action=f"Remove the line; set it under `{home}`.",
        )
    of_ladder = {name: value for name, (_, value) in shared.items()}
    channels = task.audit_channels
    unless_named: dict[str, object] = {
        "position_channel": channels.position,
        "reference_channel": channels.reference,
        "calibration_phase": channels.calibration_phase,
        "context_channels": list(channels.context),
        "ignored_channels": [c.name for c in task.observation.channels if c.stream == PHASE_STREAM],
        "persistence_lag_rows": horizons.prediction_horizon,
    }
    missing = {k: v for k, v in unless_named.items() if k not in settings.model_fields_set}
    return settings.model_copy(update=of_ladder | missing)


def replay_episode(task: Task, data: Dataset, episode_uuid: str) -> str:
    """Outcome of an episode's actions, replayed in simulation from its recorded start.

    The actions before the first whole observation are no frames, but the robot executed them.
    """
    position = data.episodes["episode_uuid"].tolist().index(episode_uuid)
    start = task.start_from_json(str(data.episodes["scene_start"].iloc[position]))
    lead = data.episodes["lead_action"].iloc[position]
    actions = data.frames.action[data.frames.episode == position]
    before = np.array([np.asarray(row) for row in lead]).reshape(-1, actions.shape[1])
    return task.replay(start, np.concatenate([before, actions]))


def round_obstacles(task: Task) -> list[Obstacle]:
    """Standing cylinders of the scene file, as circles in the base frame's plane, m."""
    shapes = CollisionModel(task.scene_path, ArmKinematics(task.scene_path)).shapes
    found = []
    for shape in shapes.scene:
        if shape.kind != "cylinder" or shape.body not in task.obstacles:
            continue
        origin, _ = shapes.nominal_bodies[shape.body]
        centre = origin + shape.position_m
        found.append(
            Obstacle(
                x_m=float(centre[0]), y_m=float(centre[1]), radius_m=float(shape.half_size_m[0])
            )
        )
    return found
