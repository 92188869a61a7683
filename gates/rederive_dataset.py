"""The dataset derived again: its statistics, its splits, and which of them was trained on.

Ingest writes the first two and whoever reads a dataset checks them, by the same functions. A fault
in those agrees with itself; here the tables are read as numbers, and nothing of `genpolicy.data` is
asked. What a training was given, its windows say themselves.
"""

from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from gates.report import Gate
from gates.settings import PARAMS_FILE, section_of
from gates.stated import compare_keys, mapping, refuse
from genpolicy.integrity.documents import read_json
from genpolicy.integrity.tables import read_table

INGEST = "artifacts/ingest"
MANIFEST = f"{INGEST}/manifest.json"
IN_TIME = ("train", "validation", "test")
TRAININGS: dict[Gate, tuple[tuple[str, str], ...]] = {
    "A": (("train_baselines", "samplers"), ("train_factors", "variants")),
    "B": (("train_generators", "samplers"),),
}
"""Stages that train for a gate, each with the key of its section that names what is trained."""
GIVEN = {"episodes": "train", "validation_episodes": "validation"}
"""Which split the episodes of a key of `training.json` are of."""
NAMED = {"train": "training", "validation": "validation"}
"""Splits as the field and every other message call them."""
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


def trainings(root: Path, gate: Gate, params: Mapping[str, Any]) -> list[Path]:
    """The folder of every training that a gate rests on, by method or variant and by seed.

    Raises:
        RefusedError: What `params.yaml` names was not trained.
        ConfigError: A section is missing.
    """
    found: list[Path] = []
    for stage, key in TRAININGS[gate]:
        place = f"artifacts/{stage}"
        found += sorted((root / place).rglob("seed_*"))
        for name in mapping(section_of(params, stage).get(key)):
            if root / place / name not in {seed.parent for seed in found}:
                required = f"a training, since {PARAMS_FILE} names it"
                refuse(gate, f"{place}/{name}", "not trained", required)
    return found


def rederive_trainings(root: Path, gate: Gate, params: Mapping[str, Any]) -> None:
    """Hold the episodes that every training of a gate was given against the splits.

    Raises:
        RefusedError: A training saw an episode of another split, does not say what it saw, or is
            not there.
        IntegrityError: A table is missing or damaged.
        BadInputError: A document cannot be read.
    """
    episodes = read_table(root / INGEST / "episodes.parquet")
    pairs = zip(episodes["episode_uuid"].to_pylist(), episodes["split"].to_pylist(), strict=True)
    split_of = dict(pairs)
    for seed in trainings(root, gate, params):
        path = seed / "training.json"
        place = path.relative_to(root).as_posix()
        if not path.is_file():
            refuse(gate, place, "missing", "what the training was given")
        document = mapping(read_json(path))
        for key, split in GIVEN.items():
            given = document.get(key)
            if not isinstance(given, list) or not given:
                refuse(gate, f"{place}: {key}", "nothing", f"episodes of the {NAMED[split]} split")
            other = [name for name in given if split_of.get(str(name)) != split]
            if other:
                named = NAMED[split]
                found = f"{len(other)} episodes outside the {named} split, among them {other[0]}"
                refuse(gate, f"{place}: {key}", found, f"episodes of the {named} split alone")


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
