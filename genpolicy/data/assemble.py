"""Accepted episodes to a dataset folder: two tables, the refusals and the manifest."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from genpolicy.contract.normalisation import Normalisation, statistics_of
from genpolicy.contract.observation import ObservationContract
from genpolicy.data.contract import ActionContract, SplitRule
from genpolicy.data.resample import Rows
from genpolicy.data.rows import EpisodeRow, FrameRow
from genpolicy.data.split import SPLITS, assign_splits, rule_as_json, split_hash
from genpolicy.errors import ContractError
from genpolicy.integrity.atomic import output_folder, write_bytes
from genpolicy.integrity.documents import canonical_json
from genpolicy.integrity.hashing import sha256_bytes, sha256_file
from genpolicy.integrity.rows import check_columns, table_of_rows
from genpolicy.integrity.tables import write_table

SCHEMA_VERSION = 1
FRAMES_FILE = "frames.parquet"
EPISODES_FILE = "episodes.parquet"
REFUSALS_FILE = "refusals.json"
MANIFEST_FILE = "manifest.json"
SEAL = "manifest_body_sha256"
STRATA = ("task", "object", "operator", "calibration_epoch", "outcome")
FLAGS = ("is_recovery", "is_intervention")
NS_PER_S = 1e9


@dataclass(frozen=True)
class AcceptedEpisode:
    """One episode that passed the contract.

    Attributes:
        episode_uuid: Lower-case UUID.
        rows: Its frames.
        strata: Values of `STRATA`.
        flags: Values of `FLAGS`; None where not recorded.
        scene_start: JSON text of the start, for replay; empty where not recorded.
        source_file: Name of the recording.
        source_sha256: Hash of its bytes.
        content_sha256: Hash of its samples, whatever the file or the UUID is called.
        recorded_at_ns: When it began, for the order of the splits.
        clock_offsets_ns: Declared offset removed from each stream.
    """

    episode_uuid: str
    rows: Rows
    strata: dict[str, str]
    flags: dict[str, bool | None]
    scene_start: str
    source_file: str
    source_sha256: str
    content_sha256: str
    recorded_at_ns: int
    clock_offsets_ns: dict[str, int]


@dataclass(frozen=True)
class Refusal:
    """One recording that did not pass: which, where in it, and why."""

    file: str
    where: str
    reason: str


@dataclass(frozen=True)
class Description:
    """What the manifest says of the whole dataset.

    Attributes:
        source_kind: Layout of the recordings.
        observation: The observation contract.
        action: The action contract.
        phases: Known phases.
        action_period_s: Time between actions, s.
        split: Shares of the splits.
        clock_note: What the times mean.
        notes: What was guessed, contradictory or not recorded, a sentence each.
        import_contract: How the columns of foreign recordings were read, if they were foreign.
    """

    source_kind: str
    observation: ObservationContract
    action: ActionContract
    phases: tuple[str, ...]
    action_period_s: float
    split: SplitRule
    clock_note: str
    notes: tuple[str, ...] = ()
    import_contract: dict[str, Any] | None = None


def write_dataset(
    out: Path,
    *,
    accepted: Sequence[AcceptedEpisode],
    refused: Sequence[Refusal],
    found: int,
    description: Description,
) -> None:
    """Write the dataset folder, whole or not at all.

    Args:
        out: The folder; an old one is replaced.
        accepted: Episodes in any order; they are stored in order of recording time.
        refused: Recordings refused.
        found: Recordings found; must be accepted + refused.
        description: Contracts, clocks and split rule.

    Raises:
        ContractError: Nothing was accepted, too little for three splits, or the counts do not
            add up.
        BadInputError: The folder cannot be written.
    """
    _check_counts(accepted, refused, found)
    episodes = sorted(accepted, key=lambda e: (e.recorded_at_ns, e.episode_uuid))
    uuids = [episode.episode_uuid for episode in episodes]
    splits = assign_splits([e.recorded_at_ns for e in episodes], uuids, description.split)
    training = [e.rows for e, split in zip(episodes, splits, strict=True) if split == "train"]
    normalisation = Normalisation(
        observation=statistics_of(np.concatenate([rows.observation for rows in training])),
        action=statistics_of(np.concatenate([rows.action for rows in training])),
    )
    refusals = {
        "found": found,
        "accepted": len(accepted),
        "refused": [asdict(refusal) for refusal in sorted(refused, key=lambda r: r.file)],
    }
    with output_folder(out) as folder:
        write_table(folder / FRAMES_FILE, frames_table(episodes, description))
        write_table(folder / EPISODES_FILE, episodes_table(episodes, splits))
        write_bytes(folder / REFUSALS_FILE, canonical_json(refusals))
        files = {
            name: sha256_file(folder / name) for name in (FRAMES_FILE, EPISODES_FILE, REFUSALS_FILE)
        }
        manifest = _manifest(episodes, splits, description, normalisation, files)
        manifest["counts"] |= {"found": found, "refused": len(refused)}
        write_bytes(folder / MANIFEST_FILE, seal(manifest))


def frames_table(episodes: Sequence[AcceptedEpisode], description: Description) -> pa.Table:
    """One row per episode and action; episodes one after the other."""
    lengths = [len(episode.rows.tick_ns) for episode in episodes]
    streams = list(episodes[0].rows.stream_event_ns)

    def seconds(arrays: list[NDArray[np.int64]]) -> pa.Array:
        return pa.array(np.concatenate(arrays) / NS_PER_S)

    columns: dict[str, pa.Array] = {
        "episode_uuid": pa.array(np.repeat([e.episode_uuid for e in episodes], lengths)),
        "index": pa.array(np.concatenate([np.arange(n, dtype=np.int32) for n in lengths])),
        "event_time_s": seconds([e.rows.tick_ns for e in episodes]),
    }
    for name in streams:
        columns[f"receive_time_s.{name}"] = seconds(
            [e.rows.stream_receive_ns[name] for e in episodes]
        )
        columns[f"event_time_s.{name}"] = seconds([e.rows.stream_event_ns[name] for e in episodes])
    columns["observation"] = _vectors(
        np.concatenate([e.rows.observation for e in episodes]), description.observation.dim
    )
    columns["action"] = _vectors(
        np.concatenate([e.rows.action for e in episodes]), description.action.dim
    )
    columns["phase"] = pa.array(np.concatenate([e.rows.phase for e in episodes]))
    check_columns(FrameRow, columns, where=FRAMES_FILE)
    return pa.table(columns)


def episodes_table(episodes: Sequence[AcceptedEpisode], splits: Sequence[str]) -> pa.Table:
    """One row per episode, in the order of the frames."""
    rows = [
        EpisodeRow(
            episode_uuid=e.episode_uuid,
            split=split,
            **_recorded(e),
            source_file=e.source_file,
            source_sha256=e.source_sha256,
            content_sha256=e.content_sha256,
            rows=len(e.rows.tick_ns),
            lead_rows=len(e.rows.lead_action),
            recorded_at_s=e.recorded_at_ns / NS_PER_S,
            lead_action=tuple(tuple(action) for action in e.rows.lead_action.tolist()),
            scene_start=e.scene_start,
        )
        for e, split in zip(episodes, splits, strict=True)
    ]
    return table_of_rows(EpisodeRow, rows)


def _recorded(episode: AcceptedEpisode) -> dict[str, Any]:
    """What the recording says of its episode, by column."""
    return {**episode.strata, **episode.flags}


def seal(manifest: dict[str, Any]) -> bytes:
    """Bytes of a manifest that carries the hash of its own other fields."""
    body = {key: value for key, value in manifest.items() if key != SEAL}
    return canonical_json({**body, SEAL: sha256_bytes(canonical_json(body))})


def content_hash(arrays: Sequence[NDArray[Any]]) -> str:
    """SHA-256 of the numbers of an episode: duplicates are found under any name."""
    body = b"".join(
        repr(array.shape).encode() + np.ascontiguousarray(array).tobytes() for array in arrays
    )
    return sha256_bytes(body)


def _vectors(values: NDArray[np.float64], dim: int) -> pa.Array:
    flat = pa.array(np.ascontiguousarray(values, dtype=np.float64).reshape(-1))
    return pa.FixedSizeListArray.from_arrays(flat, dim)


def _check_counts(
    accepted: Sequence[AcceptedEpisode], refused: Sequence[Refusal], found: int
) -> None:
    if len(accepted) + len(refused) != found:
        raise ContractError(
            where="the dataset",
            found=f"{len(accepted)} accepted + {len(refused)} refused",
            expected=f"{found} found",
            action="Report this: a recording was dropped silently.",
        )
    if not accepted:
        first = refused[0] if refused else Refusal("-", "-", "no recordings were given")
        raise ContractError(
            where="the dataset",
            found=f"0 of {found} recordings accepted; first: {first.reason}",
            expected="at least 3 accepted recordings",
            action="Correct the recordings, or the contract that they are held against.",
        )


def _manifest(
    episodes: Sequence[AcceptedEpisode],
    splits: Sequence[str],
    description: Description,
    normalisation: Normalisation,
    files: dict[str, str],
) -> dict[str, Any]:
    rule = rule_as_json(description.split)
    rows = [len(episode.rows.tick_ns) for episode in episodes]
    observation, action = description.observation, description.action
    # Absent where there is nothing to say: manifests written before these fields keep their bytes.
    optional: dict[str, Any] = {}
    if description.notes:
        optional["notes"] = list(description.notes)
    if description.import_contract is not None:
        optional["import_contract"] = description.import_contract
    return {
        **optional,
        "schema_version": SCHEMA_VERSION,
        "source_kind": description.source_kind,
        "tasks": sorted({episode.strata["task"] for episode in episodes}),
        "observation_contract": {
            "sha256": observation.hash(),
            "dim": observation.dim,
            "channels": [_channel_json(channel) for channel in observation.channels],
        },
        "action_contract": {
            "sha256": action.sha256,
            "dim": action.dim,
            "frame": action.frame,
            "components": list(action.components),
            "units": list(action.units),
            "period_s": description.action_period_s,
        },
        "phases": list(description.phases),
        "clocks": {
            "note": description.clock_note,
            "resampling": "causal zero-order hold by event time and receive time at action ticks",
            "offsets_removed_ns": _offsets(episodes),
        },
        "split": {
            "rule": rule,
            "sha256": split_hash(rule, [e.episode_uuid for e in episodes], splits),
            "episodes": {name: splits.count(name) for name in SPLITS},
            "strata": _strata(episodes, splits),
        },
        "normalisation": normalisation.as_json(),
        "counts": {"accepted": len(episodes), "rows": sum(rows)},
        "files": files,
    }


def _channel_json(channel: Any) -> dict[str, Any]:
    return {**asdict(channel), "components": list(channel.components)}


def _offsets(episodes: Sequence[AcceptedEpisode]) -> dict[str, dict[str, list[int]]]:
    """Declared offsets by stream and calibration epoch."""
    result: dict[str, dict[str, set[int]]] = {}
    for episode in episodes:
        for stream, offset in episode.clock_offsets_ns.items():
            by_epoch = result.setdefault(stream, {})
            by_epoch.setdefault(episode.strata["calibration_epoch"], set()).add(offset)
    return {s: {e: sorted(v) for e, v in epochs.items()} for s, epochs in result.items()}


def _strata(
    episodes: Sequence[AcceptedEpisode], splits: Sequence[str]
) -> dict[str, dict[str, dict[str, int]]]:
    """Episodes by split, stratum and value, so that a split without a stratum is seen."""
    return {
        split: {
            name: dict(
                sorted(
                    Counter(
                        e.strata[name] for e, s in zip(episodes, splits, strict=True) if s == split
                    ).items()
                )
            )
            for name in STRATA
        }
        for split in SPLITS
    }
