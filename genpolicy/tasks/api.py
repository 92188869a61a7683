"""What a task must offer: scene, contract, world, phases, fallback, recordings.

A task is a plug-in of the entry-point group `genpolicy.tasks`. Nothing outside a task's package
knows what it manipulates: the library asks.

Conventions of the scene file: geom groups 1 robot, 2 held object, 3 scene; the arm's body tree
first; a site `tcp` behind its last joint; a site `target` where the held object goes in, if
anywhere; a weld from the hand to the held object, if there is one.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.observation import ObservationContract
from genpolicy.errors import ConfigError
from genpolicy.robot.limits import RobotLimits

if TYPE_CHECKING:
    from genpolicy.data.recording.episode import RecordedEpisode

Array = NDArray[np.float64]
Picture = NDArray[np.uint8]

ENTRY_POINT_GROUP = "genpolicy.tasks"
NOMINAL_PROBE = "nominal"


@dataclass(frozen=True)
class Workspace:
    """Box that the TCP may not leave.

    Attributes:
        lower_m: Lowest x, y, z in the robot base frame, m.
        upper_m: Highest x, y, z, m.
    """

    lower_m: tuple[float, float, float]
    upper_m: tuple[float, float, float]


@dataclass(frozen=True)
class AuditChannels:
    """Which of the task's observations the audit of its data reads, by name.

    Attributes:
        position: Position of the TCP, m.
        reference: Observed pose of what the task ends at; None where there is none.
        calibration_phase: Phase whose first row gives the calibration residual.
        context: Channels that are held against the modes.
    """

    position: str
    reference: str | None = None
    calibration_phase: str = ""
    context: tuple[str, ...] = ()


@dataclass(frozen=True)
class WorldSettings:
    """What may differ between worlds that begin from one start.

    Attributes:
        calibration_epoch: Which camera calibration the observations carry.
        probe: Name of an out-of-distribution probe of the task, `<probe>@<severity>` for a graded
            one (1 is as the task defines it), or `nominal`.
        seed: Seed of the probe's own disturbances (sensor noise of a probe, for instance).
    """

    calibration_epoch: str
    probe: str = NOMINAL_PROBE
    seed: int = 0


@dataclass(frozen=True)
class EpisodeSpec:
    """Everything that decides one demonstration, chosen before anything is simulated.

    Attributes:
        root_seed: Seed under which all of the episode's streams are named.
        index: Number of the episode, from 0; later episodes are later in time.
        kind: What the operator is to do (task-specific; `nominal` for a plain success).
        operator: Who demonstrates.
        object_name: What is manipulated.
        calibration_epoch: Camera calibration and clock offsets in force.
        mode: Which of the valid ways the operator chose.
        start: Where the episode begins.
        start_time_ns: Host clock at the first action, ns.
    """

    root_seed: int
    index: int
    kind: str
    operator: str
    object_name: str
    calibration_epoch: str
    mode: str
    start: Start
    start_time_ns: int


class Start(Protocol):
    """The drawn numbers that a world begins from."""

    def to_json(self) -> str:
        """Canonical JSON text, for replay."""
        ...


class World(Protocol):
    """One simulated robot cell; knows nothing of policies."""

    @property
    def phase(self) -> str:
        """Task phase, from the measured state."""
        ...

    @property
    def calibration_epoch(self) -> str:
        """Camera calibration in force."""
        ...

    @property
    def q_meas(self) -> Array:
        """Measured joint positions, rad. Shape (J,)."""
        ...

    @property
    def tcp_pose(self) -> tuple[Array, Array]:
        """Measured TCP position (3,), m, and rotation (3, 3) in the base frame."""
        ...

    @property
    def last_action(self) -> Array:
        """Target commanded last. Shape (D_a,)."""
        ...

    @property
    def contact_force_n(self) -> float:
        """Largest contact force on robot and held object during the last `advance`, N."""
        ...

    @property
    def collision(self) -> bool:
        """A forbidden contact happened during the last `advance`."""
        ...

    @property
    def success(self) -> bool:
        """The task's success test holds now, and no forbidden contact ever happened."""
        ...

    def state_sha256(self) -> str:
        """Hash of the full integration state, the scene's poses and the active constraints."""
        ...

    def observe(self) -> Array:
        """Observation now, without noise or delay. Shape (D_o,)."""
        ...

    def command(self, action: Array) -> None:
        """Set the target that the controller reaches at the end of the next `advance`.

        Raises:
            NonFiniteError: The action holds NaN, infinity, or a rotation that is none.
        """
        ...

    def hold(self) -> None:
        """Keep the last target."""
        ...

    def advance(self) -> None:
        """Simulate one action period."""
        ...

    def apply_force(self, force_n: Array, duration_s: float) -> None:
        """Push the hand from now on. Force in the base frame, N, shape (3,)."""
        ...


class Task(Protocol):
    """A manipulation task."""

    @property
    def name(self) -> str:
        """Name under which the task is registered."""
        ...

    @property
    def scene_path(self) -> Path:
        """The MJCF file that alone describes robot and scene."""
        ...

    @property
    def observation(self) -> ObservationContract:
        """Contract of the observation vector."""
        ...

    @property
    def phases(self) -> tuple[str, ...]:
        """Phases, in the order of the one-hot channel."""
        ...

    @property
    def contact_phases(self) -> frozenset[str]:
        """Phases in which the held object may touch the target; empty without contact."""
        ...

    @property
    def opening_phases(self) -> frozenset[str]:
        """Phases in which the gripper may let go; empty without a gripper."""
        ...

    @property
    def free_phases(self) -> frozenset[str]:
        """Phases of motion in the open, with room around; faults that need room go there."""
        ...

    @property
    def obstacles(self) -> tuple[str, ...]:
        """Movable bodies of the scene that stand free in the way, by name; the nearest first."""
        ...

    @property
    def limits(self) -> RobotLimits:
        """Limits of the task's robot, with their source; as many joints as the scene's arm."""
        ...

    @property
    def audit_channels(self) -> AuditChannels:
        """What the audit of the task's data reads."""
        ...

    @property
    def workspace(self) -> Workspace:
        """Where the TCP may be."""
        ...

    @property
    def calibration_epochs(self) -> tuple[str, ...]:
        """Names of the calibration epochs, in order of time."""
        ...

    def sample_start(self, rng: np.random.Generator) -> Start:
        """Draw a start."""
        ...

    def start_from_json(self, text: str) -> Start:
        """The start that `Start.to_json` wrote.

        Raises:
            BadInputError: The text is not such a start.
        """
        ...

    def make_world(self, start: Start, *, settings: WorldSettings) -> World:
        """A world at rest at the start; equal arguments give equal state hashes."""
        ...

    @property
    def posture_rad(self) -> Array:
        """Joint positions from which inverse kinematics begins. Shape (J,)."""
        ...

    def action_at(self, observation: Array) -> Array:
        """The action that would keep the observed pose. Shapes (D_o,) to (D_a,)."""
        ...

    def phase_of(self, observation: Array) -> str:
        """Task phase that an observation (D_o,) states."""
        ...

    def mode_of(self, path_m: Array, observation: Array) -> str:
        """Which of the valid ways a TCP path (n, 3) takes, or `unassigned`."""
        ...

    def scene_poses(self, observation: Array) -> dict[str, tuple[Array, Array]]:
        """Position (3,), m, and quaternion (4,), w x y z, of each movable body, as observed."""
        ...

    def picture(self, start: Start, *, width_px: int, height_px: int) -> Picture:
        """Picture of the cell at a start, red, green, blue; shape (height_px, width_px, 3).

        The same bytes every time, without a display.
        """
        ...

    def fallback(self, world: World, kind: str) -> Array:
        """Classical plan from the world's state, actions of shape (n, D_a) at 20 Hz."""
        ...

    def episode_specs(
        self, root_seed: int, episodes: int, *, shares: Mapping[str, float] | None = None
    ) -> list[EpisodeSpec]:
        """Plan of a recording session; simulates nothing."""
        ...

    def record_episode(self, spec: EpisodeSpec) -> RecordedEpisode:
        """Demonstrate and record one episode."""
        ...

    def replay(self, start: Start, actions: Array) -> str:
        """Outcome (`success` or `failure`) of recorded actions (n, D_a) replayed open loop."""
        ...


@cache
def _registered(path: tuple[str, ...]) -> dict[str, EntryPoint]:
    """Tasks by name, of what is installed there: read once, since that takes a while."""
    return {point.name: point for point in entry_points(group=ENTRY_POINT_GROUP)}


def find_task(name: str) -> EntryPoint:
    """The entry point of the task registered as `name`; loads nothing.

    Raises:
        ConfigError: No task has that name; the message lists the known ones.
    """
    found = _registered(tuple(sys.path))
    if name not in found:
        raise ConfigError(
            where="the task's name",
            found=repr(name),
            expected=f"one of {sorted(found)}",
            action=f"Name a registered task, or register yours in the group {ENTRY_POINT_GROUP}.",
        )
    return found[name]


def load_task(name: str) -> Task:
    """The task registered as `name`.

    Raises:
        ConfigError: No task has that name; the message lists the known ones.
    """
    task: Task = find_task(name).load()
    return task
