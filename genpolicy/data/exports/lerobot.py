"""A verified dataset as a LeRobotDataset v3.0, for whoever trains with LeRobot.

One split at a time: who trains on the export of the training split cannot have seen what the
candidate is held against. Layout: `lerobot/datasets` of LeRobot 0.4 (codebase version v3.0).
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from genpolicy.data.dataset import Dataset
from genpolicy.data.recording.episode import JOINTS_STREAM, ROBOT_STREAM
from genpolicy.errors import ContractError
from genpolicy.integrity.documents import canonical_json

Array = NDArray[np.float64]

VERSION = "v3.0"
INFO, STATS, TASKS = "meta/info.json", "meta/stats.json", "meta/tasks.parquet"
PROVENANCE = "meta/genpolicy.json"
CHUNK_FILE = "chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
DATA_PATH = f"data/{CHUNK_FILE}"
EPISODES_PATH = f"meta/episodes/{CHUNK_FILE}"
FILES_PER_CHUNK = 1000
MAXIMUM_FILE_BYTES = 100 << 20
STATE, ENVIRONMENT, ACTION = "observation.state", "observation.environment_state", "action"
COUNTERS = ("timestamp", "frame_index", "episode_index", "index", "task_index")
QUANTILES = (0.01, 0.10, 0.50, 0.90, 0.99)
LABELS = (
    *("episode_uuid", "outcome", "operator", "object", "calibration_epoch"),
    *("is_recovery", "is_intervention"),
)


@dataclass(frozen=True)
class Exported:
    """What was written.

    Attributes:
        episodes: How many episodes.
        frames: How many frames.
        left_out: Episodes of the split that were left out, because they did not succeed.
        features: Width of each feature that a policy reads or predicts.
    """

    episodes: int
    frames: int
    left_out: int
    features: dict[str, int]


@dataclass
class _Features:
    """Columns of the observation and the action, by LeRobot's name."""

    names: dict[str, list[str]] = field(default_factory=dict)
    columns: dict[str, list[int]] = field(default_factory=dict)


@dataclass(frozen=True)
class _Place:
    """Where an episode stands in the export: its number, the tasks there are, frames a second."""

    number: int
    tasks: list[str]
    fps: int


def export_lerobot(data: Dataset, folder: Path, *, split: str) -> Exported:
    """Write a split.

    LeRobot's policies take a state or pictures of the robot and, without pictures, a state of the
    environment: channels of the streams `robot` and `joints` are the first, all others the second.
    Where outcomes are recorded only successes are written, as for our own training.

    Args:
        data: A verified dataset.
        folder: Empty folder to write into.
        split: `train`, `validation` or `test`.

    Raises:
        ContractError: No such split, nothing to write, or a rate that is no whole number of Hz.
    """
    fps = _fps(float(data.manifest["action_contract"]["period_s"]))
    part = data.split(split)
    outcomes = part.episodes["outcome"].to_numpy()
    known = (data.episodes["outcome"].to_numpy() == "success").any()
    chosen = np.flatnonzero(outcomes == "success") if known else np.arange(len(outcomes))
    if not len(chosen):
        raise ContractError(
            where=f"split {split}",
            found="without an episode",
            expected="at least one",
            action="Export another split.",
        )
    features = _features(data.manifest)
    tasks = sorted(part.episodes["task"].iloc[chosen].unique().tolist())
    tables = [
        _frames(part, int(row), features, _Place(number, tasks, fps))
        for number, row in enumerate(chosen)
    ]
    places = _write_data(folder, tables)
    episodes = part.episodes.iloc[chosen].reset_index(drop=True)
    _write_episodes(folder, episodes, tables, places)
    _write_tasks(folder, tasks)
    whole = pa.concat_tables(tables)
    _write_json(
        folder / STATS, {name: _stats(_numbers(whole, name)) for name in whole.column_names}
    )
    _write_json(folder / INFO, _info(features, len(chosen), whole.num_rows, len(tasks), fps))
    _write_json(folder / PROVENANCE, {
        "dataset_manifest_sha256": data.manifest_sha256,
        "split": split,
        "observation_contract": data.manifest["observation_contract"],
        "action_contract": data.manifest["action_contract"],
        "episodes": episodes["episode_uuid"].tolist(),
    })  # fmt: skip
    return Exported(
        len(chosen), whole.num_rows, len(outcomes) - len(chosen),
        {name: len(columns) for name, columns in features.columns.items()},
    )  # fmt: skip


def _fps(period_s: float) -> int:
    rate = 1.0 / period_s
    if abs(rate - round(rate)) > 1e-6 * rate:
        raise ContractError(
            where="the period of the dataset's actions",
            found=f"{period_s:g} s",
            expected="a whole number of actions in a second, as LeRobot counts frames",
            action="Record, or import, at such a rate.",
        )
    return round(rate)


def _features(manifest: dict[str, Any]) -> _Features:
    found = _Features()
    start = 0
    for channel in manifest["observation_contract"]["channels"]:
        own = channel["stream"] in (ROBOT_STREAM, JOINTS_STREAM)
        name = STATE if own else ENVIRONMENT
        width = len(channel["components"])
        found.columns.setdefault(name, []).extend(range(start, start + width))
        found.names.setdefault(name, []).extend(
            f"{channel['name']}.{component}" for component in channel["components"]
        )
        start += width
    if STATE not in found.columns:  # nothing says what is the robot's own
        found.columns[STATE], found.names[STATE] = (
            found.columns.pop(ENVIRONMENT), found.names.pop(ENVIRONMENT),
        )  # fmt: skip
    components = manifest["action_contract"]["components"]
    found.columns[ACTION], found.names[ACTION] = list(range(len(components))), list(components)
    return found


def _frames(part: Dataset, row: int, features: _Features, place: _Place) -> pa.Table:
    """Frames of an episode; `index` is filled when its place is known."""
    keep = np.flatnonzero(part.frames.episode == row)
    length = len(keep)
    columns: dict[str, pa.Array] = {}
    for name, places in features.columns.items():
        values = part.frames.action if name == ACTION else part.frames.observation
        numbers = np.ascontiguousarray(values[keep][:, places], dtype=np.float32)
        flat = pa.array(numbers.ravel())
        # LeRobot reads a feature of shape (1,) as a column of numbers, and refuses lists of one.
        columns[name] = (
            pa.FixedSizeListArray.from_arrays(flat, len(places)) if len(places) > 1 else flat
        )
    frame = np.arange(length, dtype=np.int64)
    task = place.tasks.index(part.episodes["task"].iloc[row])
    columns |= {
        "timestamp": pa.array((frame / place.fps).astype(np.float32)),
        "frame_index": pa.array(frame),
        "episode_index": pa.array(np.full(length, place.number, dtype=np.int64)),
        "index": pa.array(frame),
        "task_index": pa.array(np.full(length, task, dtype=np.int64)),
    }
    return pa.table(columns)


def _write_data(folder: Path, tables: list[pa.Table]) -> list[tuple[int, int, int]]:
    """Data files of whole episodes, a row group each; chunk, file and first frame of each."""
    places: list[tuple[int, int, int]] = []
    number, size, first = 0, 0, 0
    writer: pq.ParquetWriter | None = None
    for place, table in enumerate(tables):
        if writer is not None and size + table.nbytes > MAXIMUM_FILE_BYTES:
            writer.close()
            writer, number, size = None, number + 1, 0
        chunk, file = divmod(number, FILES_PER_CHUNK)
        if writer is None:
            path = folder / DATA_PATH.format(chunk_index=chunk, file_index=file)
            path.parent.mkdir(parents=True, exist_ok=True)
            writer = pq.ParquetWriter(path, table.schema, compression="snappy")
        index = pa.array(np.arange(first, first + len(table), dtype=np.int64))
        at = table.column_names.index("index")
        tables[place] = table.set_column(at, "index", index)
        writer.write_table(tables[place])
        places.append((chunk, file, first))
        size, first = size + table.nbytes, first + len(table)
    if writer is not None:
        writer.close()
    return places


def _write_episodes(
    folder: Path, episodes: pd.DataFrame, tables: list[pa.Table],
    places: list[tuple[int, int, int]],
) -> None:  # fmt: skip
    """What LeRobot looks up by episode, its statistics, and what was recorded of it."""
    rows = []
    for number, (table, (chunk, file, first)) in enumerate(zip(tables, places, strict=True)):
        row: dict[str, Any] = {
            "episode_index": number,
            "tasks": [episodes["task"].iloc[number]],
            "length": len(table),
            "data/chunk_index": chunk,
            "data/file_index": file,
            "dataset_from_index": first,
            "dataset_to_index": first + len(table),
            "meta/episodes/chunk_index": 0,
            "meta/episodes/file_index": 0,
        }
        row |= {name: episodes[name].iloc[number] for name in LABELS}
        for name in table.column_names:
            for kind, values in _stats(_numbers(table, name)).items():
                row[f"stats/{name}/{kind}"] = values
        rows.append(row)
    path = folder / EPISODES_PATH.format(chunk_index=0, file_index=0)
    path.parent.mkdir(parents=True)
    pq.write_table(pa.Table.from_pylist(rows), path, compression="snappy")


def _write_tasks(folder: Path, tasks: list[str]) -> None:
    """LeRobot looks tasks up by the index of a data frame, which is their text."""
    table = pd.DataFrame(
        {"task_index": np.arange(len(tasks), dtype=np.int64)}, index=pd.Index(tasks, name="task")
    )
    table.to_parquet(folder / TASKS)


def _numbers(table: pa.Table, name: str) -> Array:
    """A column as numbers (rows, width)."""
    column = table[name].combine_chunks()
    flat = column.flatten() if pa.types.is_fixed_size_list(column.type) else column
    values: Array = flat.to_numpy(zero_copy_only=False).astype(np.float64).reshape(len(table), -1)
    return values


def _stats(values: Array) -> dict[str, list[Any]]:
    """Statistics of a feature, by LeRobot's names; of each number over all frames."""
    quantiles = np.quantile(values, QUANTILES, axis=0)
    return {
        "min": values.min(axis=0).tolist(),
        "max": values.max(axis=0).tolist(),
        "mean": values.mean(axis=0).tolist(),
        "std": values.std(axis=0).tolist(),
        "count": [len(values)],
        **{
            f"q{100 * level:02.0f}": row.tolist()
            for level, row in zip(QUANTILES, quantiles, strict=True)
        },
    }


def _info(features: _Features, episodes: int, frames: int, tasks: int, fps: int) -> dict[str, Any]:
    described: dict[str, Any] = {
        name: {"dtype": "float32", "shape": [len(columns)], "names": features.names[name]}
        for name, columns in features.columns.items()
    }
    for name in COUNTERS:
        kind = "float32" if name == "timestamp" else "int64"
        described[name] = {"dtype": kind, "shape": [1], "names": None}
    return {
        "codebase_version": VERSION,
        "robot_type": None,
        "total_episodes": episodes,
        "total_frames": frames,
        "total_tasks": tasks,
        "chunks_size": FILES_PER_CHUNK,
        "data_files_size_in_mb": MAXIMUM_FILE_BYTES >> 20,
        "video_files_size_in_mb": 500,
        "fps": fps,
        "splits": {"train": f"0:{episodes}"},
        "data_path": DATA_PATH,
        "video_path": None,
        "features": described,
    }


def _write_json(path: Path, content: dict[str, Any]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(canonical_json(content))
