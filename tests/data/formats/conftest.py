"""One small synthetic task, two joints and a gripper, written in the layouts of others."""

import importlib.util
import json
import sys
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

sys.path.insert(0, str(Path(__file__).parent))

RATE_HZ = 20.0
NAMES = ["shoulder_pan", "elbow_flex", "gripper"]


def samples(number, rows=30):
    """State and action (rows, 3) of episode `number`: joint angles and a gripper from 0 to 1."""
    rng = np.random.default_rng(number)
    phase = rng.uniform(0, 1) + np.arange(rows + 3) / 12
    gripper = (1 + np.sin(phase)) / 2
    path = np.stack([np.sin(phase), 0.5 * np.cos(1.3 * phase), gripper], axis=1)
    noise = np.clip(rng.normal(0, 1e-4, (rows, 3)), -1e-3, 1e-3)
    state = path[:rows] + noise
    state[:, 2] = np.clip(state[:, 2], 0, 1)
    return state, path[3:]


def vectors(values, kind="f4"):
    flat = pa.array(np.asarray(values, dtype=kind).reshape(-1))
    return pa.FixedSizeListArray.from_arrays(flat, np.shape(values)[1])


def lerobot_table(number, first=0, rows=30, **changes):
    """One episode as LeRobot stores it."""
    state, action = samples(number, rows)
    index = np.arange(rows, dtype="i8")
    columns = {
        "observation.state": vectors(state),
        "action": vectors(action),
        "timestamp": pa.array((index / RATE_HZ).astype("f4")),
        "frame_index": pa.array(index),
        "episode_index": pa.array(np.full(rows, number, "i8")),
        "index": pa.array(first + index),
        "task_index": pa.array(np.zeros(rows, "i8")),
    }
    return pa.table({**columns, **changes})


def feature(names, size=3):
    return {"dtype": "float32", "shape": [size], "names": names}


def info(version="v2.1", episodes=6, **changes):
    plain = {
        "codebase_version": version,
        "robot_type": "arm",
        "total_episodes": episodes,
        "total_frames": 30 * episodes,
        "fps": 20,
        "features": {
            "observation.state": feature([NAMES]),
            "action": feature({"motors": NAMES}),
            "observation.images.top": {"dtype": "video", "shape": [4, 4, 3], "names": None},
            **{
                name: {"dtype": "int64", "shape": [1], "names": None}
                for name in ("frame_index", "episode_index", "index", "task_index")
            },
            "timestamp": {"dtype": "float32", "shape": [1], "names": None},
        },
    }
    if version.startswith("v2"):
        plain["data_path"] = "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet"
    return {**plain, **changes}


def write(path: Path, data):
    path.parent.mkdir(parents=True, exist_ok=True)
    if isinstance(data, pa.Table):
        pq.write_table(data, path)
    elif isinstance(data, list):
        path.write_text("".join(json.dumps(item) + "\n" for item in data))
    else:
        path.write_text(json.dumps(data))


def lerobot_v2(root: Path, count=6, **changes):
    """A LeRobot v2.1 dataset."""
    write(root / "meta" / "info.json", info(episodes=count, **changes))
    write(
        root / "meta" / "episodes.jsonl",
        [{"episode_index": i, "tasks": ["push"], "length": 30} for i in range(count)],
    )
    write(root / "meta" / "tasks.jsonl", [{"task_index": 0, "task": "push the block"}])
    for i in range(count):
        write(data_file(root, i), lerobot_table(i, first=30 * i))
    return root


def data_file(root: Path, number):
    return root / "data" / "chunk-000" / f"episode_{number:06d}.parquet"


def lerobot_v3(root: Path, count=6, per_file=4, **changes):
    """A LeRobot v3.0 dataset: several episodes per file, one row group each."""
    write(root / "meta" / "info.json", info("v3.0", episodes=count, **changes))
    tasks = pa.table({"task_index": pa.array([0]), "task": pa.array(["push the block"])})
    write(root / "meta" / "tasks.parquet", tasks)
    episodes = {
        "episode_index": pa.array(range(count)),
        "length": pa.array([30] * count),
        "operator": pa.array([f"op{i % 2}" for i in range(count)]),
        "stats/action/min": pa.array([[0.0]] * count),
    }
    write(root / "meta" / "episodes" / "chunk-000" / "file-000.parquet", pa.table(episodes))
    for file, start in enumerate(range(0, count, per_file)):
        path = root / "data" / "chunk-000" / f"file-{file:03d}.parquet"
        path.parent.mkdir(parents=True, exist_ok=True)
        stop = min(start + per_file, count)
        parts = [lerobot_table(i, first=30 * i) for i in range(start, stop)]
        with pq.ParquetWriter(path, parts[0].schema) as writer:
            for part in parts:
                writer.write_table(part)
    return root


class Layouts:
    """What the tests need of this file (tests are not a package)."""

    RATE_HZ = RATE_HZ
    samples = staticmethod(samples)
    vectors = staticmethod(vectors)
    info = staticmethod(info)
    feature = staticmethod(feature)
    write = staticmethod(write)
    table = staticmethod(lerobot_table)
    file = staticmethod(data_file)
    v2 = staticmethod(lerobot_v2)
    v3 = staticmethod(lerobot_v3)


@pytest.fixture(scope="session")
def layouts():
    return Layouts


@pytest.fixture(scope="session")
def factory():
    """Synthetic MCAP episodes."""
    path = Path(__file__).parents[1] / "factory.py"
    spec = importlib.util.spec_from_file_location("dataset_factory", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
