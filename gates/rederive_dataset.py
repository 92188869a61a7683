"""The dataset derived again: its statistics and its splits, in words of this file alone.

Ingest writes both and whoever reads a dataset checks both, by the same functions. A fault in those
agrees with itself; here the tables are read as numbers, and nothing of `genpolicy.data` is asked.
"""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from gates.stated import compare_keys, mapping, refuse
from genpolicy.integrity.documents import read_json
from genpolicy.integrity.tables import read_table

INGEST = "artifacts/ingest"
MANIFEST = f"{INGEST}/manifest.json"
IN_TIME = ("train", "validation", "test")
TIES_S = 1e-3
"""Recordings that began within it are of one time: the rule has nanoseconds, tables seconds."""


def rederive_dataset(root: Path) -> None:
    """Hold the manifest's statistics and the splits against the tables of the dataset.

    Raises:
        RefusedError: A minimum or maximum is not that of the rows of the training split, or an
            episode of a split was recorded after one of a later split.
        IntegrityError: A table is missing or damaged.
        BadInputError: The manifest cannot be read.
    """
    frames = read_table(root / INGEST / "frames.parquet")
    episodes = read_table(root / INGEST / "episodes.parquet")
    uuids, splits = (episodes[name].to_pylist() for name in ("episode_uuid", "split"))
    _in_time(splits, episodes["recorded_at_s"].to_numpy())
    training = [uuid for uuid, split in zip(uuids, splits, strict=True) if split == IN_TIME[0]]
    rows = np.isin(np.array(frames["episode_uuid"].to_pylist()), training)
    stated = mapping(mapping(read_json(root / MANIFEST)).get("normalisation"))
    how = "over the rows of the training split"
    for part in ("observation", "action"):
        place = f"{MANIFEST}: normalisation.{part}"
        if not rows.any():
            refuse("A", place, "numbers", "none: no row is of the training split")
        compare_keys("A", place, mapping(stated.get(part)), _extremes(frames[part], rows), how)


def _extremes(column: pa.ChunkedArray, rows: NDArray[np.bool_]) -> dict[str, list[float]]:
    flat = pc.list_flatten(column).to_numpy().astype(np.float64)
    if len(flat) == 0 or len(flat) % len(rows) != 0:
        refuse("A", f"{INGEST}/frames.parquet", "rows of unequal length", "one vector in each row")
    values = flat.reshape(len(rows), -1)[rows]
    return {"minimum": values.min(axis=0).tolist(), "maximum": values.max(axis=0).tolist()}


def _in_time(splits: list[str], began_s: NDArray[np.float64]) -> None:
    """No episode of a split began after one of a later split."""
    place = f"{INGEST}/episodes.parquet: split"
    for before, after in pairwise(IN_TIME):
        earlier = began_s[[split == before for split in splits]]
        later = began_s[[split in IN_TIME[IN_TIME.index(after) :] for split in splits]]
        if len(earlier) == 0 or len(later) == 0:
            refuse("A", place, f"no episode of {before} or none after it", "some of each")
        if not later.min() + TIES_S - earlier.max() >= 0:
            found = f"an episode of {before} that began after one of {after}"
            refuse("A", place, found, "training before validation before test, by recording time")
