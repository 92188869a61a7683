"""Small synthetic episodes, written without a simulator: a straight motion with three phases."""

import json
from dataclasses import replace
from uuid import UUID

import numpy as np
from scipy.spatial.transform import Rotation

from genpolicy.contract.action import join_action
from genpolicy.contract.observation import Channel, ObservationContract
from genpolicy.contract.rotation import rotation_to_6d
from genpolicy.data.contract import TCP_ACTION, IngestContract, plausible_ranges
from genpolicy.data.ingest import ingest_recordings
from genpolicy.data.recording.episode import RecordedEpisode, StreamSamples
from genpolicy.data.recording.writer import write_episode
from genpolicy.seeds import stream as random_stream

PHASES = ("approach", "align", "insert")
OBSERVATION = ObservationContract(
    (
        Channel("tcp_position_m", ("x", "y", "z"), "m", "robot", 0.1),
        Channel("tcp_rotation", ("c0x", "c0y", "c0z", "c1x", "c1y", "c1z"), "1", "robot", 0.1),
        Channel("gripper_opening_m", ("opening",), "m", "robot", 0.1),
        Channel("wrench_n", ("x", "y", "z"), "N", "force", 0.1),
        Channel("target_pose", ("x_m", "y_m", "cos_yaw", "sin_yaw"), "1", "camera", 0.2),
        Channel("post_position_m", ("y",), "m", "camera", 0.2),
        Channel("phase", PHASES, "1", "phase", 10.0),
    )
)
OFFSETS_NS = {"robot": 3_000_000, "force": -2_000_000, "camera": 11_000_000, "action": 0}
START_NS = 1_000_000_000_000
PERIOD_NS = 50_000_000
DOWN = np.diag([1.0, -1.0, -1.0])


def episode(number=0, *, steps=12, joints=False, start_ns=None, **metadata):
    """Episode `number`: `steps` actions at 20 Hz, robot 100 Hz, camera 30 Hz, clocks apart."""
    rng = random_stream(7, "factory", number)
    start = START_NS + number * 60_000_000_000 if start_ns is None else start_ns
    side = 1.0 if number % 2 else -1.0
    end = start + steps * PERIOD_NS
    yaw = rng.uniform(-0.25, 0.25)

    def position(time_ns):
        u = (np.asarray(time_ns) - start) / (end - start)
        y = side * 0.12 * np.sin(np.pi * np.clip(u, 0, 1))
        return np.stack([0.37 + 0.25 * u, y, np.full_like(u, 0.15)], axis=-1)

    def samples(name, rate_hz, delay_ns, values_of):
        period = round(1e9 / rate_hz)
        event = np.arange(start - 200_000_000, end, period, dtype=np.int64)
        delays = delay_ns + rng.integers(0, 1_000_000, len(event))
        return StreamSamples(name, event + OFFSETS_NS[name], event + delays, values_of(event))

    spin = Rotation.from_euler("z", rng.uniform(-0.1, 0.1)).as_matrix() @ DOWN
    columns = rotation_to_6d(spin)

    def robot(event):
        n = len(event)
        noise = rng.normal(0, 1e-4, (n, 3))
        return np.concatenate(
            [position(event) + noise, np.tile(columns, (n, 1)), np.zeros((n, 1))], axis=1
        )

    target = [0.64, 0.01 * side, np.cos(yaw), np.sin(yaw), rng.uniform(-0.01, 0.01)]
    action_event = start + PERIOD_NS * np.arange(steps, dtype=np.int64)
    actions = join_action(
        position(action_event + PERIOD_NS), np.tile(spin, (steps, 1, 1)), np.zeros(steps)
    )
    streams = {
        "robot": samples("robot", 100, 1_000_000, robot),
        "force": samples("force", 100, 1_000_000, lambda e: rng.normal(0, 0.1, (len(e), 3))),
        "camera": samples("camera", 30, 20_000_000, lambda e: np.tile(target, (len(e), 1))),
        "action": StreamSamples("action", action_event, action_event + 200_000, actions),
    }
    if joints:
        base = streams["robot"]
        angle = np.linspace(0, 0.5, len(base))[:, None] + np.linspace(-1, 1, 7)
        streams["joints"] = replace(base, stream="joints", values=angle)
    changes = [start - 200_000_000 + k * (end - start) // 3 for k in range(len(PHASES))]
    events = tuple((int(t), int(t) + 1_000_000, p) for t, p in zip(changes, PHASES, strict=True))
    offsets = {f"clock_offset_{name}_ns": str(value) for name, value in OFFSETS_NS.items()}
    plain = {
        "task": "reach", "object": "peg_a", "operator": f"op{number % 2}",
        "calibration_epoch": "c0", "outcome": "success", "is_recovery": "false",
        "is_intervention": "false", "scene_start": json.dumps({"number": number}),
        "robot": "panda", "clock_offset_joints_ns": "3000000", **offsets, **metadata,
    }  # fmt: skip
    return RecordedEpisode(str(UUID(int=(0xABC << 64) + number)), streams, events, plain)


def with_stream(recorded, name, **changes):
    """The episode with fields of one stream replaced."""
    streams = {**recorded.streams, name: replace(recorded.streams[name], **changes)}
    return replace(recorded, streams=streams)


def without_stream(recorded, name):
    """The episode without one stream."""
    return replace(recorded, streams={k: v for k, v in recorded.streams.items() if k != name})


def contract(**changes):
    """Ingest contract of the factory's episodes."""
    ranges = plausible_ranges(
        OBSERVATION,
        TCP_ACTION,
        workspace_lower_m=np.array([0.30, -0.22, 0.02]),
        workspace_upper_m=np.array([0.72, 0.22, 0.28]),
    )
    fields = {"observation": OBSERVATION, "phases": PHASES, "ranges": ranges, **changes}
    return IngestContract(**fields)


def write_all(folder, episodes):
    """Write episodes as e000.mcap, …; returns the paths."""
    paths = [folder / f"e{number:03d}.mcap" for number in range(len(episodes))]
    for path, recorded in zip(paths, episodes, strict=True):
        write_episode(path, recorded)
    return paths


def build(folder, count=7, **changes):
    """A dataset of `count` good episodes in folder/dataset; returns its path."""
    paths = write_all(folder, [episode(number, **changes) for number in range(count)])
    ingest_recordings(paths, contract=contract(), out=folder / "dataset")
    return folder / "dataset"
