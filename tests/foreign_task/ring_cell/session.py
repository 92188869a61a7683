"""The scripted operator, and what the sensors record of it."""

import uuid
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from genpolicy.contract.action import action_contract_hash, join_action
from genpolicy.contract.rotation import rotation_to_6d
from genpolicy.data.recording.episode import RecordedEpisode, StreamSamples, clock_offset_key
from genpolicy.integrity.hashing import sha256_bytes
from genpolicy.seeds import stream
from genpolicy.tasks.api import EpisodeSpec
from ring_cell.cell import (
    CLEAR_M,
    DOWN,
    HOVER_M,
    OBSERVATION,
    PAD_TOP_M,
    PERIOD_S,
    PILLAR_X_M,
    TOUCH_M,
    RingWorld,
)

SIDES = ("north", "south")
EPOCHS = ("spring", "autumn")
OPERATORS = {"elm": 1.0, "fir": 1.15}
FIRST_NS, SPACING_NS = 1_700_000_000_000_000_000, 60_000_000_000
PASS_M = 0.09
FINE = 5  # sensor samples of robot and joints in a period
DELAY_NS = {"robot": 2_000_000, "joints": 2_000_000, "lidar": 20_000_000, "action": 300_000}


def eased(points_m, duration_s):
    """Positions along a path at minimum jerk, one per period, without the first point."""
    count = max(2, round(duration_s / PERIOD_S))
    s = np.arange(1, count + 1) / count
    share = s**3 * (10 - 15 * s + 6 * s * s)
    if len(points_m) == 2:
        return points_m[0] + share[:, None] * (points_m[1] - points_m[0])
    lengths = np.linalg.norm(np.diff(points_m, axis=0), axis=1)
    knots = np.concatenate([[0.0], np.cumsum(lengths)])
    return CubicSpline(knots, points_m)(share * knots[-1])


def route(start, side, slowness):
    """Around the pillar, down over the pad, a while there, and up. Shape (n, 10)."""
    sign = 1.0 if side == SIDES[0] else -1.0
    over = np.array([*start.pad_m, HOVER_M])
    low = np.array([*start.pad_m, PAD_TOP_M + TOUCH_M])
    high = np.array([*start.pad_m, PAD_TOP_M + CLEAR_M])
    via = np.array([PILLAR_X_M, start.pillar_y_m + sign * PASS_M, HOVER_M])
    parts = [
        eased(np.array([start.probe_m, via, over]), 2.6 * slowness),
        np.tile(over, (2, 1)),
        eased(np.array([over, low]), 1.6 * slowness),
        np.tile(low, (5, 1)),
        eased(np.array([low, high]), 1.2 * slowness),
    ]
    path = np.concatenate(parts)
    return join_action(path, np.broadcast_to(DOWN, (len(path), 3, 3)), np.zeros(len(path)))


@dataclass(frozen=True)
class Done:
    """What happened: fine poses and joints, actions, phases before each and after the last."""

    robot: np.ndarray
    joints: np.ndarray
    actions: np.ndarray
    phases: tuple[str, ...]
    success: bool


def demonstrate(spec: EpisodeSpec) -> Done:
    world = RingWorld(spec.start, spec.calibration_epoch)
    actions = route(spec.start, spec.mode, OPERATORS[spec.operator])
    robot, joints, phases = [], [], [world.phase]
    for action in actions:
        before, q_before = world.observe()[:9], world.q_meas
        world.command(action)
        world.advance()
        share = np.arange(FINE)[:, None] / FINE
        robot.append(before + share * (world.observe()[:9] - before))
        joints.append(q_before + share * (world.q_meas - q_before))
        phases.append(world.phase)
    return Done(
        np.concatenate(robot), np.concatenate(joints), actions, tuple(phases), world.success
    )


def record_episode(spec: EpisodeSpec) -> RecordedEpisode:
    done = demonstrate(spec)
    noise = stream(spec.root_seed, "sensors", spec.index)
    period_ns = round(1e9 * PERIOD_S)
    ticks = spec.start_time_ns + period_ns * np.arange(len(done.actions), dtype=np.int64)
    fine = spec.start_time_ns + period_ns // FINE * np.arange(len(done.robot), dtype=np.int64)
    seen = np.array([*spec.start.pad_m, spec.start.pillar_y_m])
    lidar = seen + 0.0003 * noise.standard_normal((len(ticks), 3))
    robot = done.robot.copy()
    robot[:, :3] += 3e-5 * noise.standard_normal((len(robot), 3))
    robot[:, 3:] = rotation_to_6d(np.broadcast_to(DOWN, (len(robot), 3, 3)))
    joints = done.joints + 5e-5 * noise.standard_normal(done.joints.shape)
    values = {
        "robot": (fine, robot), "joints": (fine, joints), "lidar": (ticks, lidar),
        "action": (ticks, done.actions),
    }  # fmt: skip
    streams = {
        name: StreamSamples(name, times, times + DELAY_NS[name], data)
        for name, (times, data) in values.items()
    }
    events = []
    for index, phase in enumerate(done.phases):
        if index == 0 or phase != done.phases[index - 1]:
            time_ns = spec.start_time_ns + index * period_ns
            events.append((time_ns, time_ns, phase))
    digest = sha256_bytes(f"ring_cell {spec.root_seed} {spec.index}".encode())
    metadata = {
        "task": "ring_cell",
        "object": spec.object_name,
        "operator": spec.operator,
        "calibration_epoch": spec.calibration_epoch,
        "outcome": "success" if done.success else "failure",
        "is_recovery": "false",
        "is_intervention": "false",
        "scene_start": spec.start.to_json(),
        "robot": "ring_six",
        "action_contract_sha256": action_contract_hash(),
        "observation_contract_sha256": OBSERVATION.hash(),
        **{clock_offset_key(name): "0" for name in (*streams, "phase")},
    }
    identity = str(uuid.UUID(hex=digest[:32], version=4))
    return RecordedEpisode(identity, streams, tuple(events), metadata)
