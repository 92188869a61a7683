"""What else was recorded of the episodes: columns that are neither observation, action nor label.

Each may be why demonstrations differ, so it travels with the dataset: one column `variable.<name>`
in `episodes.parquet`, sealed with it. A value that holds for the whole episode is stored as it is;
one that switches inside an episode as runs, `[{row, value}, …]`. A dataset without such columns
has the bytes that it always had.
"""

import contextlib
import os
import shutil
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
from numpy.typing import NDArray

from genpolicy.data.assemble import EPISODES_FILE, MANIFEST_FILE, seal
from genpolicy.integrity.atomic import output_folder, write_bytes
from genpolicy.integrity.documents import read_json
from genpolicy.integrity.hashing import sha256_file
from genpolicy.integrity.tables import read_table, write_table

PREFIX = "variable."
MAXIMUM_TEXT = 200
RUN = pa.struct([("row", pa.int32()), ("value", pa.string())])
RUN_OF_NUMBERS = pa.struct([("row", pa.int32()), ("value", pa.float64())])
Value = str | float


@dataclass(frozen=True)
class Runs:
    """One column in one episode.

    Attributes:
        rows: Where each value begins; the first is 0.
        values: The values, all text or all numbers; "" or NaN where it was not recorded.
    """

    rows: tuple[int, ...]
    values: tuple[Value, ...]


Recorded = Mapping[str, Mapping[str, Runs]]
"""Runs by column and identifier of the episode; an episode may lack a column."""


def runs_of(values: NDArray[Any]) -> Runs:
    """The runs of equal values of one column in one episode.

    Args:
        values: Numbers, flags or text by row. Shape (n,), n >= 1.
    """
    if values.dtype.kind in "fiub":
        numbers = values.astype(np.float64)
        same = (numbers[1:] == numbers[:-1]) | (np.isnan(numbers[1:]) & np.isnan(numbers[:-1]))
        starts = np.concatenate([[0], np.flatnonzero(~same) + 1])
        return Runs(tuple(starts.tolist()), tuple(numbers[starts].tolist()))
    starts = np.concatenate([[0], np.flatnonzero(values[1:] != values[:-1]) + 1])
    return Runs(tuple(starts.tolist()), tuple(_text(value) for value in values[starts].tolist()))


def varying(recorded: Recorded, episodes: int) -> Recorded:
    """The columns that are not the same everywhere.

    Args:
        recorded: What was recorded of the accepted episodes.
        episodes: How many were accepted.
    """
    return {name: runs for name, runs in recorded.items() if _varies(runs, episodes)}


def _varies(by_episode: Mapping[str, Runs], episodes: int) -> bool:
    values = {value for runs in by_episode.values() for value in runs.values}
    # NaN differs from itself; a column of NaN alone holds nothing.
    some = {value for value in values if not (isinstance(value, float) and np.isnan(value))}
    missing = len(by_episode) < episodes or len(some) < len(values)
    return len(some) + missing > 1 and bool(some - {""})


@contextlib.contextmanager
def completed(out: Path, recorded: Recorded) -> Iterator[Path]:
    """Where to write a dataset, which gets its variables before it appears at `out`.

    Without variables it is `out` itself. With some, the dataset is written beside it, completed
    and moved: whole or not at all, and the old one is removed only once the new one is whole.

    Args:
        out: The dataset folder.
        recorded: What was recorded; episodes that were not accepted are left out.

    Raises:
        BadInputError: The place cannot be written.
    """
    if not recorded:
        yield out
        return
    beside = out.with_name(f".{out.name}.plain.{os.getpid()}")
    try:
        yield beside
        _add(beside, recorded)
        with output_folder(out) as folder:
            for path in sorted(beside.iterdir()):
                os.replace(path, folder / path.name)
    finally:
        shutil.rmtree(beside, ignore_errors=True)


def stored(episodes: pd.DataFrame) -> dict[str, list[Runs | None]]:
    """The columns of a dataset's table of episodes, by name; None where an episode lacks one."""
    found = [str(name) for name in episodes.columns if str(name).startswith(PREFIX)]
    return {
        name.removeprefix(PREFIX): [_runs(value) for value in episodes[name].tolist()]
        for name in sorted(found)
    }


def _add(folder: Path, recorded: Recorded) -> None:
    """Add the columns to the table of episodes, and seal the manifest again."""
    table = read_table(folder / EPISODES_FILE)
    uuids = table["episode_uuid"].to_pylist()
    for name, by_episode in sorted(recorded.items()):
        runs = [by_episode.get(uuid) for uuid in uuids]
        table = table.append_column(f"{PREFIX}{name}", _column(runs))
    write_table(folder / EPISODES_FILE, table)
    manifest = read_json(folder / MANIFEST_FILE)
    manifest["files"][EPISODES_FILE] = sha256_file(folder / EPISODES_FILE)
    write_bytes(folder / MANIFEST_FILE, seal(manifest))


def _column(runs: list[Runs | None]) -> pa.Array:
    known = [item for item in runs if item is not None]
    numbers = all(isinstance(value, float) for item in known for value in item.values)
    if not numbers:
        known = [Runs(item.rows, tuple(map(_text, item.values))) for item in known]
        texts = iter(known)
        runs = [None if item is None else next(texts) for item in runs]
    if all(len(item.values) == 1 for item in known):
        kind = pa.float64() if numbers else pa.string()
        return pa.array([None if item is None else item.values[0] for item in runs], type=kind)
    listed = [
        None
        if item is None
        else [{"row": r, "value": v} for r, v in zip(item.rows, item.values, strict=True)]
        for item in runs
    ]
    return pa.array(listed, type=pa.list_(RUN_OF_NUMBERS if numbers else RUN))


def _runs(value: Any) -> Runs | None:
    # A table of pandas says NaN for whatever is missing.
    if value is None or (isinstance(value, float) and np.isnan(value)):
        return None
    if isinstance(value, str | float):
        return Runs((0,), (value,))
    items = list(value)
    return Runs(tuple(int(i["row"]) for i in items), tuple(i["value"] for i in items))


def _text(value: Any) -> str:
    if isinstance(value, bytes):
        value = value.decode("utf-8", errors="replace")
    if isinstance(value, float):
        value = "" if np.isnan(value) else int(value) if value.is_integer() else value
    return "" if value is None else str(value)[:MAXIMUM_TEXT]
