"""Tight insertion: as on the tabletop, with a peg that must be felt into its hole."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from genpolicy.data.recording.episode import RecordedEpisode
from genpolicy.tasks.api import EpisodeSpec, Start, Task, WorldSettings
from genpolicy.tasks.tabletop_insertion import episodes, sessions
from genpolicy.tasks.tabletop_insertion.observation import OBSERVATION
from genpolicy.tasks.tabletop_insertion.task import UNASSIGNED, TabletopInsertion, own_start
from genpolicy.tasks.tight_insertion.operators import SearchingOperator
from genpolicy.tasks.tight_insertion.start import (
    LEFT_OUT_Y_M,
    TightStart,
    sample_start,
    start_from_json,
)
from genpolicy.tasks.tight_insertion.world import CAMERA_NOISE_M, SCENE_PATH, TightWorld

Array = NDArray[np.float64]

PARTS = episodes.TaskParts(
    task="tight_insertion",
    start=TightStart,
    world=TightWorld,
    operator=SearchingOperator,
    camera_noise_m=CAMERA_NOISE_M,
)


class TightInsertion(TabletopInsertion):
    """The task whose contact cannot be avoided; see `genpolicy.tasks.api.Task`."""

    name: str = PARTS.task
    scene_path: Path = SCENE_PATH

    def sample_start(self, rng: np.random.Generator) -> TightStart:
        """Draw a start."""
        return sample_start(rng)

    def start_from_json(self, text: str) -> TightStart:
        """The start that `Start.to_json` wrote."""
        return start_from_json(text)

    def make_world(self, start: Start, *, settings: WorldSettings) -> TightWorld:
        """A world at rest at the start."""
        return TightWorld(own_start(start, TightStart), settings=settings)

    def mode_of(self, path_m: Array, observation: Array) -> str:
        """Side on which a path passes the post; unassigned where none stands."""
        post_y_m = float(observation[OBSERVATION.slices["post_position_m"]][0])
        if post_y_m > 0.5 * LEFT_OUT_Y_M:
            return UNASSIGNED
        return super().mode_of(path_m, observation)

    def episode_specs(
        self, root_seed: int, episodes: int, *, shares: Mapping[str, float] | None = None
    ) -> list[EpisodeSpec]:
        """Plan of a recording session."""
        return sessions.episode_specs(root_seed, episodes, shares=shares, draw_start=sample_start)

    def record_episode(self, spec: EpisodeSpec) -> RecordedEpisode:
        """Demonstrate and record one episode."""
        return episodes.record_episode(spec, PARTS)

    def replay(self, start: Start, actions: Array) -> str:
        """Outcome of recorded actions replayed open loop."""
        return episodes.replay(own_start(start, TightStart), actions, PARTS)


TASK: Task = TightInsertion()
