"""A recording session: planned as a whole, demonstrated in shards, written as MCAP."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from genpolicy.compute import map_shards
from genpolicy.data.recording.writer import write_episode
from genpolicy.tasks.api import EpisodeSpec, load_task


@dataclass(frozen=True)
class SessionShard:
    """Some episodes of a session, for one process.

    Attributes:
        task: Registered name of the task.
        specs: Plans of the episodes.
        folder: Where the recordings go.
    """

    task: str
    specs: tuple[EpisodeSpec, ...]
    folder: Path


def record_session(
    task_name: str,
    *,
    root_seed: int,
    episodes: int,
    shares: Mapping[str, float] | None,
    folder: Path,
    workers: int,
    scheduler: str,
) -> list[str]:
    """Record a session of the task's scripted operators.

    Args:
        task_name: Registered name.
        root_seed: Root seed.
        episodes: How many episodes.
        shares: Share of each kind of episode, or None for the task's own.
        folder: Existing folder for the recordings.
        workers: Local processes.
        scheduler: `local` or the address of a Dask scheduler.

    Returns:
        File names, in order of the episodes; the bytes do not depend on the workers.
    """
    specs = load_task(task_name).episode_specs(root_seed, episodes, shares=shares)
    size = max(1, min(20, len(specs) // (2 * workers) or 1))
    shards = [
        SessionShard(task_name, tuple(specs[first : first + size]), folder)
        for first in range(0, len(specs), size)
    ]
    parts = map_shards(record_shard, shards, workers=workers, scheduler=scheduler)
    return [name for part in parts for name in part]


def record_shard(shard: SessionShard) -> list[str]:
    """Demonstrate and write the episodes of one shard; returns their file names."""
    task = load_task(shard.task)
    names = []
    for spec in shard.specs:
        name = f"episode_{spec.index:05d}.mcap"
        write_episode(shard.folder / name, task.record_episode(spec))
        names.append(name)
    return names
