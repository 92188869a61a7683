"""Tabletop insertion: pass a post on either side, put a peg into a hole, let go, withdraw."""

from collections.abc import Mapping
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.action import GRIPPER, POSITION
from genpolicy.contract.horizons import HorizonConfig
from genpolicy.contract.observation import ObservationContract
from genpolicy.data.recording.episode import RecordedEpisode
from genpolicy.errors import ContractError
from genpolicy.robot.limits import PANDA, RobotLimits
from genpolicy.tasks.api import (
    AuditChannels,
    EpisodeSpec,
    Picture,
    Start,
    Task,
    Workspace,
    World,
    WorldSettings,
)
from genpolicy.tasks.tabletop_insertion import episodes, fallback, scene, sessions
from genpolicy.tasks.tabletop_insertion.experts import SIDES
from genpolicy.tasks.tabletop_insertion.observation import (
    CONTACT_PHASES,
    FREE_PHASES,
    OBSERVATION,
    OPENING_PHASES,
    PHASES,
)
from genpolicy.tasks.tabletop_insertion.picture import draw
from genpolicy.tasks.tabletop_insertion.planner import plan_insertion
from genpolicy.tasks.tabletop_insertion.probes import EPOCHS
from genpolicy.tasks.tabletop_insertion.start import InsertionStart, sample_start, start_from_json
from genpolicy.tasks.tabletop_insertion.world import TabletopWorld

Array = NDArray[np.float64]
S = TypeVar("S", bound=InsertionStart)

# The ceiling keeps the tip of the held peg below the top of the post.
WORKSPACE = Workspace(lower_m=(0.30, -0.22, 0.02), upper_m=(0.72, 0.22, 0.24))


UNASSIGNED = "unassigned"
CLEAR_SIDE_M = 0.03
PAST_POST_M = 0.05


class TabletopInsertion:
    """The default task; see `genpolicy.tasks.api.Task` for each member's meaning."""

    name: str = episodes.TASK_NAME
    scene_path: Path = scene.SCENE_PATH
    observation: ObservationContract = OBSERVATION
    phases: tuple[str, ...] = PHASES
    contact_phases: frozenset[str] = CONTACT_PHASES
    opening_phases: frozenset[str] = OPENING_PHASES
    free_phases: frozenset[str] = FREE_PHASES
    obstacles: tuple[str, ...] = (scene.POST,)
    limits: RobotLimits = PANDA
    audit_channels: AuditChannels = AuditChannels(
        position="tcp_position_m",
        reference="hole_pose",
        calibration_phase="release",
        context=("hole_pose",),
    )
    workspace: Workspace = WORKSPACE
    calibration_epochs: tuple[str, ...] = tuple(EPOCHS)

    def sample_start(self, rng: np.random.Generator) -> InsertionStart:
        """Draw a start."""
        return sample_start(rng)

    def start_from_json(self, text: str) -> InsertionStart:
        """The start that `Start.to_json` wrote."""
        return start_from_json(text)

    def make_world(self, start: Start, *, settings: WorldSettings) -> TabletopWorld:
        """A world at rest at the start."""
        return TabletopWorld(own_start(start, InsertionStart), settings=settings)

    def scene_poses(self, observation: Array) -> dict[str, tuple[Array, Array]]:
        """Where the observation puts each movable body of the scene: (m (3,), wxyz (4,))."""
        hole = observation[OBSERVATION.slices["hole_pose"]]
        return scene.scene_poses(
            hole_xy_m=hole[:2],
            hole_yaw_rad=float(np.arctan2(hole[3], hole[2])),
            post_y_m=float(observation[OBSERVATION.slices["post_position_m"]][0]),
        )

    @property
    def posture_rad(self) -> Array:
        """The controller's posture."""
        return np.array(scene.POSTURE_RAD)

    def action_at(self, observation: Array) -> Array:
        """The action that would keep the observed pose and opening."""
        slices = OBSERVATION.slices
        parts = ("tcp_position_m", "tcp_rotation", "gripper_opening_m")
        return np.concatenate([observation[slices[name]] for name in parts])

    def phase_of(self, observation: Array) -> str:
        """Phase of the one-hot channel."""
        return PHASES[int(np.argmax(observation[OBSERVATION.slices["phase"]]))]

    def mode_of(self, path_m: Array, observation: Array) -> str:
        """Side on which a path passes the post: `left` at larger y, `right` at smaller y.

        Unassigned where the path begins beyond the post, or leaves its plane by less than 3 cm.
        """
        post_y_m = float(observation[OBSERVATION.slices["post_position_m"]][0])
        before = path_m[path_m[:, 0] < scene.POST_X_M + PAST_POST_M]
        if path_m[0, 0] >= scene.POST_X_M or not len(before):
            return UNASSIGNED
        offset = before[:, 1] - post_y_m
        widest = float(offset[np.argmax(np.abs(offset))])
        if not abs(widest) - CLEAR_SIDE_M >= 0:
            return UNASSIGNED
        return SIDES[0] if widest > 0 else SIDES[1]

    def picture(self, start: Start, *, width_px: int, height_px: int) -> Picture:
        """The cell at a start, ray cast."""
        world = self.make_world(start, settings=WorldSettings(self.calibration_epochs[0]))
        return draw(world.model, world.data, width=width_px, height=height_px)

    def fallback(self, world: World, kind: str) -> Array:
        """Classical plan from the last commanded pose; kinds `retreat`, `classical_return`."""
        action = world.last_action
        return fallback.plan(
            kind,
            tcp_m=action[POSITION],
            yaw_rad=float(np.arctan2(action[4], action[3])),
            gripper_opening_m=float(action[GRIPPER]),
            post_y_m=float(world.observe()[OBSERVATION.slices["post_position_m"]][0]),
        )

    def planner(self, history: Array, *, horizons: HorizonConfig) -> Array:
        """A chunk (K, 10) of the classical planner, from what every policy sees (H_o, 24)."""
        return plan_insertion(history, horizons=horizons)

    def episode_specs(
        self, root_seed: int, episodes: int, *, shares: Mapping[str, float] | None = None
    ) -> list[EpisodeSpec]:
        """Plan of a recording session."""
        return sessions.episode_specs(root_seed, episodes, shares=shares)

    def record_episode(self, spec: EpisodeSpec) -> RecordedEpisode:
        """Demonstrate and record one episode."""
        return episodes.record_episode(spec)

    def replay(self, start: Start, actions: Array) -> str:
        """Outcome of recorded actions replayed open loop."""
        return episodes.replay(own_start(start, InsertionStart), actions)


def own_start(start: Start, expected: type[S]) -> S:
    """The start, where it is one of the task's own.

    Raises:
        ContractError: It is another task's.
    """
    if not isinstance(start, expected):
        raise ContractError(
            where="the start",
            found=type(start).__name__,
            expected=expected.__name__,
            action="Draw it with this task's sample_start or start_from_json.",
        )
    return start


TASK: Task = TabletopInsertion()
