"""The dataset derived again from its recordings: whoever writes other rows is contradicted.

All that stands on a dataset agrees with a forged one, and `dvc commit` records it as readily as the
true one. Recordings that the task demonstrates lie among the evidence. Those of one's own are known
by the hashes that stage `task` took of them: where they do not lie here, as on the machine of who
reads a bundle, the dataset is held by its own hash alone. A dataset that was brought is its files.
"""

from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from gates.rederive_audit import difference
from gates.rederive_dataset import INGEST, MANIFEST
from gates.rederive_shadow import TaskSection
from gates.settings import section_of
from gates.stated import mapping, refuse, section, short
from genpolicy.contract.horizons import HorizonConfig
from genpolicy.data.assemble import MANIFEST_FILE, REFUSALS_FILE, SEAL
from genpolicy.data.of_task import IngestSection, ingest_of_task
from genpolicy.errors import GenpolicyError
from genpolicy.integrity.documents import read_json
from genpolicy.integrity.hashing import sha256_file
from genpolicy.integrity.tables import read_table

RECORDED = "artifacts/record/episodes"
SOURCE = "artifacts/task/source.json"
TABLES = ("episodes", "frames")
OF_BYTES = ("files", SEAL)
"""Hashes of the manifest: of tables, whose last digits another processor rounds otherwise."""
TOLERANCE, LAST_DIGITS = 1e-9, 4 * float(np.finfo(np.float64).eps)
"""Of a number, and of large ones (moments of a clock) as a share of it: another processor rounds
otherwise."""


def rederive_ingest(root: Path, params: Mapping[str, Any]) -> None:
    """Hold every table and document of the dataset against its recordings.

    Args:
        root: Root of the workspace.
        params: `params.yaml`.

    Raises:
        RefusedError: A row, a number of it or what was refused is not what the recordings give, a
            recording of one's own is another than stage `task` saw, or the recordings give no
            dataset.
        ConfigError: A section of `params.yaml` cannot be read.
        IntegrityError: A table is missing or damaged.
        BadInputError: A document cannot be read.
    """
    files = _recordings(root, section_of(params, "source"))
    if files is None:
        return
    period_s = section(params, "horizons", HorizonConfig).action_period_s
    task = section(params, "task", TaskSection).name
    shares = section(params, "ingest", IngestSection)
    with TemporaryDirectory() as folder:
        again = Path(folder) / "ingest"
        try:
            ingest_of_task(files, again, task=task, action_period_s=period_s, section=shares)
        except GenpolicyError as error:
            refuse("A", INGEST, "a dataset", f"what its recordings give: {error}")
        _hold(root / INGEST, again)


def _recordings(root: Path, source: Mapping[str, Any]) -> list[Path] | None:
    """The recordings under a dataset; None where they do not lie here or are a dataset."""
    kind = source.get("kind")
    if kind == "embedded":
        return sorted((root / RECORDED).glob("*.mcap"))
    seen = mapping(mapping(read_json(root / SOURCE)).get("files"))
    if kind == "dataset":
        for name, stated in sorted(seen.items()):
            path = root / INGEST / name
            if not path.is_file() or sha256_file(path) != stated:
                refuse("A", f"{INGEST}/{name}", "another file", "the one that was brought")
        return None
    folder = root / str(source.get("path"))
    if not folder.is_dir():
        return None
    files = sorted(folder.glob("*.mcap"))
    for name in sorted(seen.keys() | {path.name for path in files}):
        path = folder / name
        if not path.is_file() or sha256_file(path) != seen.get(name):
            refuse("A", f"{source.get('path')}/{name}", "another file", f"the one of {SOURCE}")
    return files


def _hold(stated: Path, again: Path) -> None:
    for name in TABLES:
        place = f"{INGEST}/{name}.parquet"
        _hold_table(place, *(read_table(at / f"{name}.parquet") for at in (stated, again)))
    for place, name in ((MANIFEST, MANIFEST_FILE), (f"{INGEST}/{REFUSALS_FILE}", REFUSALS_FILE)):
        told, found = (mapping(read_json(at / name)) for at in (stated, again))
        told, found = ({k: v for k, v in d.items() if k not in OF_BYTES} for d in (told, found))
        if other := difference(told, found):
            where, said, expected = other
            refuse("A", f"{place}: {where}", short(said), f"{short(expected)}, as recorded")


def _hold_table(place: str, stated: pa.Table, again: pa.Table) -> None:
    """Rows in order, all columns; the first difference is named by its episode and row."""
    if stated.schema.remove_metadata() != again.schema.remove_metadata():
        refuse("A", f"{place}: columns", str(stated.schema.names), str(again.schema.names))
    if stated.num_rows != again.num_rows:
        refuse("A", place, f"{stated.num_rows} rows", f"{again.num_rows}, as recorded")
    for name in again.schema.names:
        other = np.flatnonzero(_differ(stated[name], again[name]))
        if len(other):
            row = int(other[0])
            told, found = (short(table[name][row].as_py()) for table in (stated, again))
            where = f"{place}: {name} of row {row} (episode {again['episode_uuid'][row]})"
            refuse("A", where, told, f"{found}, as recorded; {len(other)} rows differ")


def _differ(told: pa.ChunkedArray, found: pa.ChunkedArray) -> NDArray[np.bool_]:
    """Rows at which two columns of one type and length say other things."""
    kind = found.type
    if pa.types.is_floating(kind):
        one, two = (column.to_numpy() for column in (told, found))
        same = np.isclose(one, two, rtol=LAST_DIGITS, atol=TOLERANCE, equal_nan=True)
        return np.asarray(~same, dtype=bool)
    if pa.types.is_fixed_size_list(kind):
        flat = _differ(pc.list_flatten(told), pc.list_flatten(found))
        return np.asarray(flat.reshape(len(found), -1).any(axis=1), dtype=bool)
    pairs = zip(told.to_pylist(), found.to_pylist(), strict=True)
    return np.array([difference(one, two) is not None for one, two in pairs], dtype=bool)
