"""What a registered task can check about its data: feasibility of a chunk, replay of an episode."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from genpolicy.audit.documents import Obstacle
from genpolicy.audit.labels import Replay
from genpolicy.audit.mean_versus_modes import Admissible
from genpolicy.data.dataset import Dataset
from genpolicy.integrity.documents import canonical_json
from genpolicy.integrity.hashing import sha256_bytes
from genpolicy.tasks.api import ENTRY_POINT_GROUP, load_task

Array = NDArray[np.float64]


@dataclass(frozen=True)
class TaskChecks:
    """What is known about a dataset through its task; nothing, if the task is not registered.

    Attributes:
        admissible: Feasibility of a chunk at a recorded observation.
        replay: Outcome of a replayed episode, by identifier.
        obstacles: Round obstacles of the scene plane, for figures.
        scene: The MJCF that describes the robot.
    """

    admissible: Admissible | None = None
    replay: Replay | None = None
    obstacles: list[Obstacle] = field(default_factory=list)
    scene: Path | None = None


def task_checks(dataset: Dataset, *, task: str | None, chunk_rows: int) -> TaskChecks:
    """The checks of the task that the dataset was recorded for.

    They are used only if the task is registered and the dataset has exactly its observations:
    another contract would be read as something that it is not.

    Args:
        dataset: A verified dataset.
        task: Name of the task; that of the dataset if absent.
        chunk_rows: Longest chunk to check.
    """
    names = [task] if task is not None else list(dataset.manifest["tasks"])
    known = {point.name for point in entry_points(group=ENTRY_POINT_GROUP)}
    if len(names) != 1 or names[0] not in known:
        return TaskChecks()
    from genpolicy.evidence.admission_context import (  # noqa: PLC0415
        admissible,
        make_checker,
    )
    from genpolicy.evidence.need.audit_task import (  # noqa: PLC0415  (loads a simulator)
        replay_episode,
        round_obstacles,
    )
    from genpolicy.feasibility.settings import FeasibilitySettings  # noqa: PLC0415

    plugin = load_task(names[0])
    if contract_hash(dataset.manifest) != plugin.observation.hash():
        return TaskChecks()
    period_s = float(dataset.manifest["action_contract"]["period_s"])
    limits = FeasibilitySettings(maximum_actions=max(16, chunk_rows))
    checker = make_checker(plugin, limits, action_period_s=period_s)

    def is_admissible(actions: Array, observation: Array) -> tuple[bool, str]:
        return admissible(plugin, checker, actions, observation, action_period_s=period_s)

    starts = dataset.episodes["scene_start"].tolist()
    recorded = all(isinstance(start, str) and start not in ("", "null", "{}") for start in starts)
    return TaskChecks(
        admissible=is_admissible,
        replay=(lambda uuid: replay_episode(plugin, dataset, uuid)) if recorded else None,
        obstacles=round_obstacles(plugin),
        scene=plugin.scene_path,
    )


def contract_hash(manifest: Mapping[str, Any]) -> str:
    """Hash of the dataset's observation contract, as `ObservationContract.hash` makes it."""
    return sha256_bytes(canonical_json(manifest["observation_contract"]["channels"]))
