"""An episode of a dataset as a replay; read by who starts a run, not by who supervises it."""

import numpy as np
from numpy.typing import NDArray

from genpolicy.data.dataset import Dataset
from genpolicy.errors import ContractError
from genpolicy.tasks.api import Task
from genpolicy.wall_clock.replay import Replay

Array = NDArray[np.float64]

FORCE_UNIT = "N"


def replay_of(data: Dataset, task: Task, episode_uuid: str) -> Replay:
    """An episode of a dataset.

    Args:
        data: The dataset, in the task's observation contract.
        task: Says which of its channels are forces: those in N.
        episode_uuid: Which episode.

    Raises:
        ContractError: The dataset has no such episode.
    """
    names = data.episodes["episode_uuid"].astype(str).tolist()
    if episode_uuid not in names:
        raise ContractError(
            where="the episode to replay",
            found=repr(episode_uuid),
            expected=f"one of the {len(names)} episodes of the dataset",
            action="Name one of them.",
        )
    number = names.index(episode_uuid)
    rows = np.flatnonzero(data.frames.episode == number)
    observations = data.frames.observation[rows]
    return Replay(
        episode_uuid=episode_uuid,
        calibration_epoch=str(data.episodes["calibration_epoch"].iloc[number]),
        phases=tuple(data.frames.phase[rows].tolist()),
        observations=_nested(observations),
        actions=_nested(data.frames.action[rows]),
        forces_n=tuple(_forces_n(task, observations).tolist()),
    )


def _forces_n(task: Task, observations: Array) -> Array:
    """Largest force of any channel of forces, N; 0 without one. Shape (n,)."""
    contract = task.observation
    found = [
        np.linalg.norm(observations[:, contract.slices[channel.name]], axis=1)
        for channel in contract.channels
        if channel.unit == FORCE_UNIT
    ]
    return np.max(found, axis=0) if found else np.zeros(len(observations))


def _nested(rows: Array) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(row) for row in rows.tolist())
