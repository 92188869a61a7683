"""A dataset in memory: loaded only if every byte and every rule of its manifest holds."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NoReturn
from uuid import UUID

import numpy as np
import pandas as pd
import pyarrow as pa

from genpolicy.contract.normalisation import Normalisation, statistics_of
from genpolicy.contract.observation import ObservationContract
from genpolicy.data.assemble import (
    EPISODES_FILE,
    FLAGS,
    FRAMES_FILE,
    MANIFEST_FILE,
    REFUSALS_FILE,
    SCHEMA_VERSION,
    STRATA,
    seal,
)
from genpolicy.data.checks import check_finite
from genpolicy.data.frames import Array, Frames, Indices, Windows
from genpolicy.data.split import SPLITS, split_hash
from genpolicy.errors import ContractError, IntegrityError
from genpolicy.integrity.documents import parse_json
from genpolicy.integrity.hashing import sha256_bytes_of
from genpolicy.integrity.tables import table_of

ACTION = "Run the stage that writes it again (`dvc repro ingest`)."
DATA_FILES = (FRAMES_FILE, EPISODES_FILE, REFUSALS_FILE)
EVENT_PREFIX, RECEIVE_PREFIX = "event_time_s.", "receive_time_s."


@dataclass(frozen=True)
class Dataset:
    """A verified dataset.

    Attributes:
        frames: All frames.
        episodes: One row per episode, in the order that `frames.episode` counts.
        manifest: The manifest, as parsed.
        manifest_sha256: Hash of its bytes; names the dataset.
        normalisation: Statistics of the training split.
    """

    frames: Frames
    episodes: pd.DataFrame
    manifest: dict[str, Any]
    manifest_sha256: str
    normalisation: Normalisation

    @property
    def observation_contract(self) -> ObservationContract:
        """The observation that it holds, as the manifest carries it."""
        return ObservationContract.of_document(self.manifest["observation_contract"]["channels"])

    def split(self, name: str) -> "Dataset":
        """The dataset of one split; `frames.episode` counts the rows of its own `episodes`.

        Raises:
            ContractError: No such split.
        """
        chosen = self._rows_of(name)
        renumbered = np.full(len(self.episodes), -1, dtype=np.int64)
        renumbered[chosen] = np.arange(len(chosen))
        keep = np.flatnonzero(renumbered[self.frames.episode] >= 0)
        frames = self.frames.rows(keep)
        frames = replace(frames, episode=renumbered[frames.episode])
        return replace(
            self, frames=frames, episodes=self.episodes.iloc[chosen].reset_index(drop=True)
        )

    def windows(
        self,
        split: str,
        observation_horizon: int,
        prediction_horizon: int,
        only_success: bool = True,
    ) -> Windows:
        """One window per frame of a split, padded at the ends of the episode by repetition.

        Args:
            split: `train`, `validation` or `test`.
            observation_horizon: H_o.
            prediction_horizon: K.
            only_success: Leave out episodes whose outcome is not `success`.

        Raises:
            ContractError: No such split, a horizon below 1, or no episode is left.
        """
        if observation_horizon < 1 or prediction_horizon < 1:
            _refuse(
                "horizons", f"{observation_horizon} and {prediction_horizon}", "at least 1 each"
            )
        chosen = self._rows_of(split)
        if only_success:
            outcome = self.episodes["outcome"].to_numpy()
            chosen = chosen[outcome[chosen] == "success"]
        if not len(chosen):
            _refuse(
                f"split {split}",
                "without an episode of outcome success",
                "at least one; pass only_success=False where outcomes were not recorded",
            )
        newest = np.flatnonzero(np.isin(self.frames.episode, chosen))
        episode, index = self.frames.episode[newest], self.frames.index[newest]
        rows = self.episodes["rows"].to_numpy(dtype=np.int64)[episode]
        first = newest - index
        back = np.arange(1 - observation_horizon, 1)
        ahead = np.arange(prediction_horizon)
        seen = first[:, None] + np.maximum(index[:, None] + back, 0)
        wanted = index[:, None] + ahead
        is_pad = wanted >= rows[:, None]
        due = first[:, None] + np.minimum(wanted, rows[:, None] - 1)
        return Windows(
            self.frames.observation[seen], self.frames.action[due], is_pad, episode, index
        )

    def _rows_of(self, split: str) -> Indices:
        if split not in SPLITS:
            _refuse("split", repr(split), f"one of {SPLITS}")
        return np.flatnonzero(self.episodes["split"].to_numpy() == split).astype(np.int64)


def load_dataset(folder: Path, verify: bool = True) -> Dataset:
    """Load a dataset folder.

    Args:
        folder: What `ingest_recordings` (or another ingest) wrote.
        verify: Hash every file against the manifest, refuse unlisted files and derive split and
            normalisation again. Off only where the caller has just done so.

    Raises:
        IntegrityError: A file is missing, unlisted, or other than the manifest says.
        ContractError: Tables and manifest contradict each other or the contract.
    """
    manifest_sha256, data = sha256_bytes_of(folder / MANIFEST_FILE, keep=True)
    where = str(folder / MANIFEST_FILE)
    manifest = parse_json(data, where=where)
    try:
        _check_manifest(manifest, where)
        if seal(manifest) != data:
            raise IntegrityError(
                where=where,
                found="changed since it was written",
                expected="the bytes that its own hash names",
                action=ACTION,
            )
        if verify:
            _check_listing(folder)
        tables = {
            name: _table(folder / name, manifest["files"][name], verify)
            for name in (FRAMES_FILE, EPISODES_FILE)
        }
        if verify:
            _bytes(folder / REFUSALS_FILE, manifest["files"][REFUSALS_FILE], verify)
        episodes = _episodes(tables[EPISODES_FILE], str(folder / EPISODES_FILE))
        frames = _frames(tables[FRAMES_FILE], episodes, manifest, str(folder / FRAMES_FILE))
        normalisation = Normalisation.from_json(manifest["normalisation"])
        dataset = Dataset(frames, episodes, manifest, manifest_sha256, normalisation)
        if verify:
            _check_derived(dataset, where)
    except (KeyError, TypeError, pa.ArrowInvalid, pa.ArrowTypeError) as error:
        raise ContractError(
            where=str(folder),
            found=f"not of the dataset schema ({error!r:.120})",
            expected=f"schema version {SCHEMA_VERSION}",
            action=ACTION,
        ) from error
    return dataset


def _check_manifest(manifest: Any, where: str) -> None:
    if not isinstance(manifest, dict) or manifest.get("schema_version") != SCHEMA_VERSION:
        _refuse(where, "of another schema version", f"schema version {SCHEMA_VERSION}")
    if set(manifest["files"]) != set(DATA_FILES):
        _refuse(f"{where}: files", str(sorted(manifest["files"]))[:120], str(sorted(DATA_FILES)))


def _check_listing(folder: Path) -> None:
    extra = sorted({path.name for path in folder.iterdir()} - {*DATA_FILES, MANIFEST_FILE})
    if extra:
        raise IntegrityError(
            where=str(folder / extra[0]),
            found="in the folder but not in its manifest",
            expected="only files that the manifest lists",
            action="Remove it; a dataset folder holds nothing else.",
        )


def _bytes(path: Path, sha256: str, verify: bool) -> bytes:
    found, data = sha256_bytes_of(path, keep=True)
    if verify and found != sha256:
        raise IntegrityError(
            where=str(path),
            found=f"a file with sha256 {found[:16]}…",
            expected=f"{str(sha256)[:16]}… from {MANIFEST_FILE}",
            action=ACTION,
        )
    return data


def _table(path: Path, sha256: str, verify: bool) -> pa.Table:
    return table_of(_bytes(path, sha256, verify), where=str(path))


def _episodes(table: pa.Table, where: str) -> pd.DataFrame:
    names = ("episode_uuid", "split", *STRATA, *FLAGS, "source_file", "source_sha256", "rows")
    missing = [name for name in (*names, "scene_start") if name not in table.column_names]
    if missing:
        _refuse(where, f"without the columns {missing}", "every column of the dataset schema")
    episodes: pd.DataFrame = table.to_pandas()
    uuids = episodes["episode_uuid"].tolist()
    if len(set(uuids)) != len(uuids):
        _refuse(where, "with an episode UUID twice", "each episode once, in one split")
    for uuid in uuids:
        try:
            valid = str(UUID(uuid)) == uuid
        except (ValueError, AttributeError):
            valid = False
        if not valid:
            _refuse(f"{where}: episode_uuid", repr(uuid)[:60], "a lower-case UUID")
    if not set(episodes["split"]) <= set(SPLITS):
        _refuse(f"{where}: split", str(sorted(set(episodes["split"])))[:80], f"one of {SPLITS}")
    return episodes


def _frames(
    table: pa.Table, episodes: pd.DataFrame, manifest: dict[str, Any], where: str
) -> Frames:
    rows = episodes["rows"].to_numpy(dtype=np.int64)
    if table.num_rows != rows.sum() or (rows < 1).any():
        _refuse(where, f"{table.num_rows} rows", f"the {rows.sum()} rows of {EPISODES_FILE}")
    episode = np.repeat(np.arange(len(rows)), rows)
    index = np.arange(len(episode)) - np.repeat(np.cumsum(rows) - rows, rows)
    stored = np.asarray(table["episode_uuid"].to_numpy(zero_copy_only=False))
    if not (stored == episodes["episode_uuid"].to_numpy()[episode]).all():
        _refuse(f"{where}: episode_uuid", "out of order", f"the order of {EPISODES_FILE}")
    if not (table["index"].to_numpy() == index).all():
        _refuse(f"{where}: index", "with a gap", "0, 1, 2, … in each episode")
    times = {
        name: table[name].to_numpy().astype(np.float64)
        for name in table.column_names
        if name.startswith(("event_time_s", "receive_time_s"))
    }
    step = np.diff(times["event_time_s"])[np.diff(episode) == 0]
    if not (step > 0).all():
        _refuse(f"{where}: event_time_s", "not increasing", "an advancing clock in each episode")
    phase = np.asarray(table["phase"].to_numpy(zero_copy_only=False), dtype=np.str_)
    if not set(np.unique(phase).tolist()) <= set(manifest["phases"]):
        _refuse(f"{where}: phase", "with an unknown phase", f"one of {manifest['phases']}")
    return Frames(
        episode=episode.astype(np.int64),
        index=index.astype(np.int64),
        event_time_s=times["event_time_s"],
        observation=_vectors(table, "observation", manifest["observation_contract"]["dim"], where),
        action=_vectors(table, "action", manifest["action_contract"]["dim"], where),
        phase=phase,
        stream_event_time_s=_by_stream(times, EVENT_PREFIX),
        stream_receive_time_s=_by_stream(times, RECEIVE_PREFIX),
    )


def _by_stream(times: dict[str, Array], prefix: str) -> dict[str, Array]:
    return {name.removeprefix(prefix): v for name, v in times.items() if name.startswith(prefix)}


def _vectors(table: pa.Table, name: str, dim: int, where: str) -> Array:
    column = table[name].combine_chunks()
    if column.type != pa.list_(pa.float64(), dim) or column.null_count:
        _refuse(f"{where}: {name}", str(column.type), f"{dim} float64 in every row")
    values: Array = column.flatten().to_numpy(zero_copy_only=False).reshape(-1, dim)
    check_finite(values, [f"{name}[{i}]" for i in range(dim)], where=where)
    return values


def _check_derived(dataset: Dataset, where: str) -> None:
    """The manifest's split hash and statistics must follow from the tables."""
    manifest, episodes = dataset.manifest, dataset.episodes
    derived = split_hash(
        manifest["split"]["rule"], episodes["episode_uuid"].tolist(), episodes["split"].tolist()
    )
    if derived != manifest["split"]["sha256"]:
        _refuse(f"{where}: split.sha256", str(manifest["split"]["sha256"])[:16], derived[:16])
    training = dataset.split("train").frames
    expected = Normalisation(statistics_of(training.observation), statistics_of(training.action))
    if expected.as_json() != dataset.normalisation.as_json():
        _refuse(
            f"{where}: normalisation", "other numbers", "minimum and maximum of the training split"
        )


def _refuse(where: str, found: str, expected: str) -> NoReturn:
    raise ContractError(where=where, found=found, expected=expected, action=ACTION)
