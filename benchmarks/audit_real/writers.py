"""A recording in the layout of others, as their own recorders write it."""

import json
from pathlib import Path

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import zarr

from benchmarks.audit_real.recording import Episode, Recording

PER_FILE = 25
DATA_V2 = "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet"


def write(recording: Recording, folder: Path) -> Path:
    """Write a recording below an empty folder.

    Returns:
        The path that a user would give.
    """
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / recording.name
    return {
        "lerobot2": _lerobot2, "lerobot3": _lerobot3, "robomimic": _robomimic, "zarr": _zarr,
        "parquet": _long_table, "parquet_files": _files,
    }[recording.layout](recording, path)  # fmt: skip


def _vector(values: np.ndarray) -> pa.Array:
    flat = pa.array(np.asarray(values, dtype=np.float32).reshape(-1))
    return pa.FixedSizeListArray.from_arrays(flat, values.shape[1])


def _tasks(recording: Recording) -> dict[str, int]:
    texts = [str(episode.facts.get("task", "")) for episode in recording.episodes]
    return {text: k for k, text in enumerate(dict.fromkeys(texts))}


def _lerobot_rows(recording: Recording, number: int, first: int) -> pa.Table:
    episode = recording.episodes[number]
    count = len(episode)
    tasks = _tasks(recording)
    columns = {name: _vector(values) for name, values in episode.seen.items()}
    columns["action"] = _vector(episode.action)
    if episode.time_s is not None:
        columns["timestamp"] = pa.array(episode.time_s.astype(np.float32))
    columns["frame_index"] = pa.array(np.arange(count))
    columns["episode_index"] = pa.array(np.full(count, number))
    columns["index"] = pa.array(first + np.arange(count))
    columns["task_index"] = pa.array(
        np.full(count, tasks[str(episode.facts.get("task", ""))], dtype=np.int64)
    )
    if isinstance(episode.facts.get("success"), bool):
        done = np.zeros(count, dtype=bool)
        done[-1] = bool(episode.facts["success"])
        columns["next.success"] = pa.array(done)
    for name, values in episode.rows.items():
        columns[name] = pa.array(np.ravel(values).tolist())
    return pa.table(columns)


def _info(recording: Recording, version: str) -> dict[str, object]:
    def feature(kind: str, names: object = None, size: int = 1) -> dict[str, object]:
        return {"dtype": kind, "shape": [size], "names": names}

    first = recording.episodes[0]
    features = {
        name: feature("float32", list(recording.names[name]) or None, values.shape[1])
        for name, values in first.seen.items()
    }
    features["action"] = feature(
        "float32", list(recording.action_names) or None, first.action.shape[1]
    )
    if first.time_s is not None:
        features["timestamp"] = feature("float32")
    features |= {
        n: feature("int64") for n in ("frame_index", "episode_index", "index", "task_index")
    }
    if isinstance(first.facts.get("success"), bool):
        features["next.success"] = feature("bool")
    kinds = {"f": "float32", "i": "int64", "b": "bool"}
    for name, values in first.rows.items():
        features[name] = feature(kinds.get(values.dtype.kind, "string"))
    return {
        "codebase_version": version, "robot_type": "unknown",
        "total_episodes": len(recording.episodes),
        "total_frames": sum(len(episode) for episode in recording.episodes),
        "total_tasks": len(_tasks(recording)), "fps": recording.rate_hz,
        "splits": {"train": f"0:{len(recording.episodes)}"}, "features": features,
    }  # fmt: skip


def _said(episode: Episode) -> dict[str, object]:
    """What the list of episodes says of one, beside its task."""
    return {
        name: value
        for name, value in episode.facts.items()
        if name != "task" and not (name == "success" and isinstance(value, bool))
    }


def _firsts(recording: Recording) -> list[int]:
    return np.concatenate([[0], np.cumsum([len(e) for e in recording.episodes])]).tolist()


def _lerobot2(recording: Recording, path: Path) -> Path:
    (path / "meta").mkdir(parents=True)
    info = _info(recording, "v2.1") | {"data_path": DATA_V2, "chunks_size": 1000}
    (path / "meta/info.json").write_text(json.dumps(info))
    lines = [
        {"episode_index": k, "tasks": [str(e.facts.get("task", ""))], "length": len(e), **_said(e)}
        for k, e in enumerate(recording.episodes)
    ]
    (path / "meta/episodes.jsonl").write_text("".join(json.dumps(x) + "\n" for x in lines))
    tasks = [{"task_index": k, "task": text} for text, k in _tasks(recording).items()]
    (path / "meta/tasks.jsonl").write_text("".join(json.dumps(x) + "\n" for x in tasks))
    (path / "data/chunk-000").mkdir(parents=True)
    for number, first in enumerate(_firsts(recording)[:-1]):
        table = _lerobot_rows(recording, number, first)
        pq.write_table(table, path / f"data/chunk-000/episode_{number:06d}.parquet")
    return path


def _lerobot3(recording: Recording, path: Path) -> Path:
    (path / "meta/episodes/chunk-000").mkdir(parents=True)
    info = _info(recording, "v3.0") | {
        "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
    }
    (path / "meta/info.json").write_text(json.dumps(info))
    tasks = _tasks(recording)
    pq.write_table(
        pa.table({"task_index": list(tasks.values()), "task": list(tasks)}),
        path / "meta/tasks.parquet",
    )
    said = [_said(episode) for episode in recording.episodes]
    table: dict[str, list[object]] = {
        "episode_index": list(range(len(said))), "length": [len(e) for e in recording.episodes],
        "tasks": [[str(e.facts.get("task", ""))] for e in recording.episodes],
    }  # fmt: skip
    table |= {name: [item[name] for item in said] for name in (said[0] if said else {})}
    pq.write_table(pa.table(table), path / "meta/episodes/chunk-000/file-000.parquet")
    (path / "data/chunk-000").mkdir(parents=True)
    firsts = _firsts(recording)
    for place, begin in enumerate(range(0, len(said), PER_FILE)):
        numbers = range(begin, min(begin + PER_FILE, len(said)))
        parts = [_lerobot_rows(recording, n, firsts[n]) for n in numbers]
        pq.write_table(pa.concat_tables(parts), path / f"data/chunk-000/file-{place:03d}.parquet")
    return path


def _robomimic(recording: Recording, path: Path) -> Path:
    path = path.with_suffix(".hdf5")
    with h5py.File(path, "w") as file:
        data = file.create_group("data")
        kwargs = {"control_freq": recording.rate_hz}
        if recording.form == "normalised":
            kwargs["controller_configs"] = {"type": "OSC_POSE", "control_delta": True}
        data.attrs["env_args"] = json.dumps({"env_name": "Lift", "type": 1, "env_kwargs": kwargs})
        data.attrs["total"] = sum(len(episode) for episode in recording.episodes)
        for number, episode in enumerate(recording.episodes):
            demo = data.create_group(f"demo_{number}")
            demo.attrs["num_samples"] = len(episode)
            for name, value in episode.facts.items():
                demo.attrs[name] = value
            demo["actions"] = episode.action
            demo["rewards"] = np.zeros(len(episode))
            demo["dones"] = (np.arange(len(episode)) == len(episode) - 1).astype(np.int64)
            for name, values in episode.seen.items():
                demo[name] = values
    return path


def _zarr(recording: Recording, path: Path) -> Path:
    path = path.with_suffix(".zarr")
    root = zarr.open_group(str(path), mode="w", zarr_format=2)
    arrays = {
        name: np.concatenate([e.seen[name] for e in recording.episodes]).astype(np.float32)
        for name in recording.episodes[0].seen
    }
    arrays["action"] = np.concatenate([e.action for e in recording.episodes]).astype(np.float32)
    for name in recording.episodes[0].rows:
        arrays[name] = np.concatenate([e.rows[name] for e in recording.episodes])
    for name, values in arrays.items():
        chunks = (min(1024, len(values)), *values.shape[1:])
        array = root.create_array(f"data/{name}", shape=values.shape, chunks=chunks,
                                  dtype=values.dtype)  # fmt: skip
        array[...] = values
    ends = np.cumsum([len(episode) for episode in recording.episodes])
    array = root.create_array("meta/episode_ends", shape=ends.shape, chunks=ends.shape,
                              dtype=ends.dtype)  # fmt: skip
    array[...] = ends
    return path


def _table(recording: Recording, number: int, *, counted: bool) -> pa.Table:
    episode = recording.episodes[number]
    columns: dict[str, object] = {}
    if counted:
        columns["episode"] = np.full(len(episode), number)
    if episode.time_s is not None:
        columns["timestamp"] = episode.time_s
    parts = [(n, v, recording.names[n]) for n, v in episode.seen.items()]
    parts.append(("action", episode.action, recording.action_names))
    for name, values, names in parts:
        if names:
            columns |= {f"{name}_{part}": values[:, k] for k, part in enumerate(names)}
        else:
            columns[name] = _vector(values)
    for name, value in episode.facts.items():
        columns[name] = [value] * len(episode)
    for name, more in episode.rows.items():
        columns[name] = np.ravel(more).tolist()
    return pa.table(columns)


def _long_table(recording: Recording, path: Path) -> Path:
    path = path.with_suffix(".parquet")
    tables = [_table(recording, n, counted=True) for n in range(len(recording.episodes))]
    pq.write_table(pa.concat_tables(tables), path)
    return path


def _files(recording: Recording, path: Path) -> Path:
    path.mkdir()
    for number in range(len(recording.episodes)):
        pq.write_table(_table(recording, number, counted=False), path / f"run_{number:04d}.parquet")
    return path
