"""Demonstrate one episode and record it as the sensors would: own rates, clocks and delays.

Event times stand on the stream's own clock, which runs ahead of the host's by the epoch's offset;
the offset declared in the metadata differs from it by a small calibration error. Receive times
stand on the host's clock and come in order.
"""

import uuid
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.action import action_contract_hash
from genpolicy.contract.rotation import rotation_to_6d
from genpolicy.data.recording.episode import (
    ACTION_STREAM,
    CAMERA_STREAM,
    FORCE_STREAM,
    JOINTS_STREAM,
    PHASE_STREAM,
    ROBOT_STREAM,
    RecordedEpisode,
    StreamSamples,
    clock_offset_key,
)
from genpolicy.errors import ContractError
from genpolicy.integrity.hashing import sha256_bytes
from genpolicy.seeds import stream
from genpolicy.tasks.api import EpisodeSpec, WorldSettings
from genpolicy.tasks.tabletop_insertion.experts import (
    RECOVERY_KINDS,
    STYLES,
    Operator,
    Order,
)
from genpolicy.tasks.tabletop_insertion.observation import OBSERVATION
from genpolicy.tasks.tabletop_insertion.probes import find_epoch
from genpolicy.tasks.tabletop_insertion.start import InsertionStart
from genpolicy.tasks.tabletop_insertion.world import ACTION_PERIOD_S, SUB_STEPS, TabletopWorld

Array = NDArray[np.float64]
Times = NDArray[np.int64]

TASK_NAME = "tabletop_insertion"
ROBOT_NAME = "panda_kinematics"
MAXIMUM_EPISODE_S = 20.0
# Physics steps between two samples of the 100 Hz streams.
SENSOR_EVERY_STEPS = 5
STEP_NS = round(1e9 * ACTION_PERIOD_S) // SUB_STEPS
CAMERA_RATE_HZ = 30.0
# Shortest and longest time from exposure to the host, s.
DELAY_S: dict[str, tuple[float, float]] = {
    ROBOT_STREAM: (0.001, 0.003),
    JOINTS_STREAM: (0.001, 0.003),
    FORCE_STREAM: (0.001, 0.002),
    CAMERA_STREAM: (0.020, 0.060),
    ACTION_STREAM: (0.0002, 0.0006),
}
# The arm's controller stamps joints and TCP with one clock.
SAME_CLOCK = {JOINTS_STREAM: ROBOT_STREAM}
# Standard deviations of white sensor noise.
POSITION_NOISE_M = 0.00003
JOINT_NOISE_RAD = 0.00005
FORCE_NOISE_N = 0.15
CAMERA_NOISE_M = 0.0003
CAMERA_NOISE_RAD = 0.002
# Standard deviation of the error of the declared clock offset, s.
DECLARED_OFFSET_ERROR_S = 0.0004


@dataclass(frozen=True)
class Demonstration:
    """What happened, on the true clock, before any sensor looked at it.

    Attributes:
        steps: Physics steps since the start of each sensor sample. Shape (m,).
        robot: TCP position, rotation and opening. Shape (m, 10).
        joints: Joint positions, rad. Shape (m, 7).
        force: Contact force, N. Shape (m, 3).
        actions: Commanded actions, one per period. Shape (n, 10).
        phases: Phase at the start of each period, and after the last. Length n + 1.
        success: The task's success test held at the end.
        collision: A forbidden contact happened.
    """

    steps: Times
    robot: Array
    joints: Array
    force: Array
    actions: Array
    phases: tuple[str, ...]
    success: bool
    collision: bool


@dataclass(frozen=True)
class TaskParts:
    """Who demonstrates where: what insertion tasks that share these sensors differ in.

    Attributes:
        task: Name of the task.
        start: Its starts.
        world: Its cell.
        operator: Its operators.
        camera_noise_m: Standard deviation of the camera's noise on every position.
    """

    task: str = TASK_NAME
    start: type[InsertionStart] = InsertionStart
    world: type[TabletopWorld] = TabletopWorld
    operator: type[Operator] = Operator
    camera_noise_m: float = CAMERA_NOISE_M


def demonstrate(spec: EpisodeSpec, parts: TaskParts = TaskParts()) -> Demonstration:
    """Let the planned operator act in the cell until it is done.

    Raises:
        ContractError: The start of the plan belongs to another task.
    """
    if type(spec.start) is not parts.start:
        raise ContractError(
            where=f"episode {spec.index}: start",
            found=type(spec.start).__name__,
            expected=parts.start.__name__,
            action="Plan the episode with this task's episode_specs.",
        )
    settings = WorldSettings(spec.calibration_epoch, seed=spec.index)
    world = parts.world(spec.start, settings=settings)
    operator = parts.operator(
        world,
        order=Order(kind=spec.kind, side=spec.mode, style=STYLES[spec.operator]),
        rng=stream(spec.root_seed, "operator", spec.index),
    )
    steps: list[int] = []
    robot: list[Array] = []
    joints: list[Array] = []
    force: list[Array] = []

    def sample(step: int) -> None:
        if step % SENSOR_EVERY_STEPS == 0:
            position, rotation = world.tcp_pose
            opening = [world.gripper_opening_m]
            steps.append(step)
            robot.append(np.concatenate([position, rotation_to_6d(rotation), opening]))
            joints.append(world.q_meas)
            force.append(world.wrench_n)

    actions: list[Array] = []
    phases = [world.phase]
    collision = False
    while world.time_s < MAXIMUM_EPISODE_S and (action := operator.act()) is not None:
        world.command(action)
        world.advance(sample)
        actions.append(action)
        phases.append(world.phase)
        collision = collision or world.collision
    return Demonstration(
        steps=np.array(steps, dtype=np.int64),
        robot=np.array(robot),
        joints=np.array(joints),
        force=np.array(force),
        actions=np.array(actions),
        phases=tuple(phases),
        success=world.success,
        collision=collision,
    )


def record_episode(spec: EpisodeSpec, parts: TaskParts = TaskParts()) -> RecordedEpisode:
    """Demonstrate one planned episode and record it; equal plans give equal recordings."""
    done = demonstrate(spec, parts)
    recorder = _Recorder(spec)
    period_ns = round(1e9 * ACTION_PERIOD_S)
    duration_ns = len(done.actions) * period_ns
    robot = done.robot.copy()
    robot[:, :3] += POSITION_NOISE_M * recorder.noise(ROBOT_STREAM, (len(robot), 3))
    joints = done.joints + JOINT_NOISE_RAD * recorder.noise(JOINTS_STREAM, done.joints.shape)
    force = done.force + FORCE_NOISE_N * recorder.noise(FORCE_STREAM, done.force.shape)
    frames_ns = np.round(np.arange(0, duration_ns, 1e9 / CAMERA_RATE_HZ)).astype(np.int64)
    ticks_ns = period_ns * np.arange(len(done.actions), dtype=np.int64)
    streams = {
        ROBOT_STREAM: recorder.samples(ROBOT_STREAM, STEP_NS * done.steps, robot),
        JOINTS_STREAM: recorder.samples(JOINTS_STREAM, STEP_NS * done.steps, joints),
        FORCE_STREAM: recorder.samples(FORCE_STREAM, STEP_NS * done.steps, force),
        CAMERA_STREAM: recorder.samples(
            CAMERA_STREAM, frames_ns, _camera(spec, recorder, len(frames_ns), parts.camera_noise_m)
        ),
        ACTION_STREAM: recorder.samples(ACTION_STREAM, ticks_ns, done.actions),
    }
    events = []
    for index, phase in enumerate(done.phases):
        if index == 0 or phase != done.phases[index - 1]:
            time_ns = spec.start_time_ns + index * period_ns
            events.append((time_ns, time_ns, phase))
    return RecordedEpisode(
        episode_uuid=_episode_uuid(spec, parts.task),
        streams=streams,
        phase_events=tuple(events),
        metadata=_metadata(spec, done, recorder, parts.task),
    )


def replay(start: InsertionStart, actions: Array, parts: TaskParts = TaskParts()) -> str:
    """Outcome of recorded actions, executed open loop from the recorded start.

    Args:
        start: Recorded start.
        actions: Recorded actions. Shape (n, 10).
        parts: Whose cell it is.

    Returns:
        `success` or `failure`.
    """
    world = parts.world(start, settings=WorldSettings("epoch_1"))
    for action in actions:
        world.command(action)
        world.advance()
    return "success" if world.success else "failure"


class _Recorder:
    """The sensors of one episode: clocks, delays and noise, each from its own stream."""

    def __init__(self, spec: EpisodeSpec) -> None:
        self._spec = spec
        self._offsets_s = find_epoch(spec.calibration_epoch).clock_offset_s

    def _rng(self, *names: str) -> np.random.Generator:
        return stream(self._spec.root_seed, "recorder", self._spec.index, *names)

    def noise(self, name: str, shape: tuple[int, ...]) -> Array:
        """White noise of a stream's values."""
        return self._rng("noise", name).standard_normal(shape)

    def offset_ns(self, name: str) -> int:
        """Clock of the stream minus clock of the host, ns."""
        return round(1e9 * self._offsets_s[SAME_CLOCK.get(name, name)])

    def declared_offset_ns(self, name: str) -> int:
        """The same as the calibration measured it; exact for the host's own streams."""
        if self.offset_ns(name) == 0:
            return 0
        clock = SAME_CLOCK.get(name, name)
        error_s = DECLARED_OFFSET_ERROR_S * self._rng("declared", clock).standard_normal()
        return self.offset_ns(name) + round(1e9 * error_s)

    def samples(self, name: str, elapsed_ns: Times, values: Array) -> StreamSamples:
        """Samples of a stream, exposed `elapsed_ns` after the start on the true clock."""
        true_ns = self._spec.start_time_ns + elapsed_ns
        shortest, longest = DELAY_S[name]
        delay_s = self._rng("delay", name).uniform(shortest, longest, len(elapsed_ns))
        receive_ns = true_ns + np.round(1e9 * delay_s).astype(np.int64)
        return StreamSamples(
            stream=name,
            event_time_ns=true_ns + self.offset_ns(name),
            receive_time_ns=np.maximum.accumulate(receive_ns),
            values=values,
        )


def _camera(spec: EpisodeSpec, recorder: _Recorder, frames: int, noise_m: float) -> Array:
    start, error = spec.start, find_epoch(spec.calibration_epoch).camera
    assert isinstance(start, InsertionStart)  # `demonstrate` has refused any other
    noise = recorder.noise(CAMERA_STREAM, (frames, 4))
    yaw = start.hole_yaw_rad + error.yaw_rad + CAMERA_NOISE_RAD * noise[:, 2]
    return np.stack(
        [
            start.hole_x_m + error.x_m + noise_m * noise[:, 0],
            start.hole_y_m + error.y_m + noise_m * noise[:, 1],
            np.cos(yaw),
            np.sin(yaw),
            start.post_y_m + error.y_m + noise_m * noise[:, 3],
        ],
        axis=1,
    )


def _episode_uuid(spec: EpisodeSpec, task: str) -> str:
    digest = sha256_bytes(f"{task} {spec.root_seed} {spec.index}".encode())
    return str(uuid.UUID(hex=digest[:32], version=4))


def _metadata(
    spec: EpisodeSpec, done: Demonstration, recorder: _Recorder, task: str
) -> dict[str, str]:
    streams = (ROBOT_STREAM, JOINTS_STREAM, FORCE_STREAM, CAMERA_STREAM, ACTION_STREAM)
    offsets = {clock_offset_key(name): str(recorder.declared_offset_ns(name)) for name in streams}
    return {
        "task": task,
        "object": spec.object_name,
        "operator": spec.operator,
        "calibration_epoch": spec.calibration_epoch,
        "outcome": "success" if done.success else "failure",
        "is_recovery": "true" if spec.kind in RECOVERY_KINDS else "false",
        "is_intervention": "false",
        "scene_start": spec.start.to_json(),
        "robot": ROBOT_NAME,
        "action_contract_sha256": action_contract_hash(),
        "observation_contract_sha256": OBSERVATION.hash(),
        clock_offset_key(PHASE_STREAM): "0",
        **offsets,
    }
