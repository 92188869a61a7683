"""MCAP recordings to a dataset: each is accepted, or refused by name with row and reason."""

import os
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from genpolicy.data.assemble import (
    FLAGS,
    STRATA,
    AcceptedEpisode,
    Description,
    Refusal,
    content_hash,
    write_dataset,
)
from genpolicy.data.checks import check_metadata, check_recording, clock_offset_ns
from genpolicy.data.contract import IngestContract, SplitRule
from genpolicy.data.recording.episode import ACTION_STREAM, REQUIRED_METADATA, RecordedEpisode
from genpolicy.data.recording.reader import read_hashed_episode
from genpolicy.data.resample import remove_clock_offsets, resample
from genpolicy.data.variables import MAXIMUM_TEXT, Runs, completed, varying
from genpolicy.errors import BadInputError, ContractError

CLOCK_NOTE = (
    "event_time_s: exposure on the host's monotonic clock, after the declared offset of each "
    "stream was subtracted; receive_time_s: arrival on the same clock"
)
CLOCK_OFFSET = "clock_offset_"


def ingest_recordings(
    files: Sequence[Path],
    *,
    contract: IngestContract,
    out: Path,
    task: str | None = None,
    split: SplitRule | None = None,
    notes: tuple[str, ...] = (),
    import_contract: dict[str, Any] | None = None,
) -> None:
    """Read recordings, hold each against the contract, write the dataset folder.

    The order of `files` does not matter. Of two recordings with the same UUID or the same
    samples, the first by name is kept and the other refused.

    Args:
        files: MCAP recordings, one episode each.
        contract: What each must satisfy.
        out: The dataset folder; whole or not at all, an old one is replaced.
        task: Task that each must name as its own; None takes recordings of any.
        split: Shares of the splits; 70 / 15 / 15 if absent.
        notes: What was guessed or not recorded, for the manifest.
        import_contract: The contract as a document, for the manifest.

    Raises:
        ContractError: No recording, or too few of them, were accepted.
        BadInputError: The folder cannot be written.
    """
    accepted: list[AcceptedEpisode] = []
    refused: list[Refusal] = []
    recorded: dict[str, dict[str, Runs]] = {}
    names = _labels(files)
    for name, path in sorted(zip(names, files, strict=True)):
        try:
            episode, more = accept_recording(path, contract=contract, label=name)
            _refuse_other_task(episode, task)
            _refuse_duplicate(episode, accepted)
            accepted.append(episode)
            for key, text in more.items():
                recorded.setdefault(key, {})[episode.episode_uuid] = Runs((0,), (text,))
        except BadInputError as error:
            refused.append(Refusal(file=name, where=error.where, reason=str(error)))
    description = Description(
        source_kind="mcap",
        observation=contract.observation,
        action=contract.action,
        phases=contract.phases,
        action_period_s=contract.action_period_s,
        split=split or SplitRule(),
        clock_note=CLOCK_NOTE,
        notes=notes,
        import_contract=import_contract,
    )
    with completed(out, varying(recorded, len(accepted))) as folder:
        write_dataset(
            folder, accepted=accepted, refused=refused, found=len(files), description=description
        )


def accept_recording(
    path: Path, *, contract: IngestContract, label: str
) -> tuple[AcceptedEpisode, dict[str, str]]:
    """Read, check and resample one recording.

    Args:
        path: The MCAP file.
        contract: What it must satisfy.
        label: What texts and tables call it.

    Returns:
        The episode, and what else its metadata say of it.

    Raises:
        BadInputError: It is not a recording, or it breaks the contract.
    """
    raw, digest = read_hashed_episode(path, where=label)
    check_metadata(raw, contract, where=label)
    stamped = remove_clock_offsets(raw, where=label)
    check_recording(stamped, contract, where=label)
    rows = resample(stamped, contract, where=label)
    metadata = raw.metadata
    more = {
        key: text[:MAXIMUM_TEXT]
        for key, text in metadata.items()
        if key not in REQUIRED_METADATA and not key.startswith(CLOCK_OFFSET)
    }
    episode = AcceptedEpisode(
        episode_uuid=raw.episode_uuid,
        rows=rows,
        strata={name: metadata[name] for name in STRATA},
        flags={name: metadata[name].lower() == "true" for name in FLAGS},
        scene_start=metadata["scene_start"],
        source_file=label,
        source_sha256=digest,
        content_sha256=_samples_hash(raw),
        recorded_at_ns=int(stamped.streams[ACTION_STREAM].event_time_ns[0]),
        clock_offsets_ns={
            name: clock_offset_ns(raw, name, where=label) for name in sorted(raw.streams)
        },
    )
    return episode, more


def _samples_hash(episode: RecordedEpisode) -> str:
    """Hash of the samples and their spacing, independent of the clock's origin."""
    arrays = []
    for name in sorted(episode.streams):
        samples = episode.streams[name]
        arrays += [samples.values, samples.event_time_ns - samples.event_time_ns[0]]
    return content_hash(arrays)


def _refuse_other_task(episode: AcceptedEpisode, task: str | None) -> None:
    """Another task may have the same streams and units; what was done is not the same."""
    recorded = episode.strata["task"]
    if task is not None and recorded != task:
        raise ContractError(
            where=f"{episode.source_file}: metadata task",
            found=repr(recorded[:60]),
            expected=repr(task),
            action="Judge it by the ladder of its own task (`params.yaml: task.name`).",
        )


def _refuse_duplicate(episode: AcceptedEpisode, accepted: Sequence[AcceptedEpisode]) -> None:
    for other in accepted:
        for field in ("episode_uuid", "content_sha256"):
            if getattr(other, field) == getattr(episode, field):
                what = "its episode_uuid" if field == "episode_uuid" else "its samples"
                raise ContractError(
                    where=episode.source_file,
                    found=f"a recording that shares {what} with {other.source_file}",
                    expected="every episode once, under one name",
                    action="Remove the copy.",
                )


def _labels(files: Sequence[Path]) -> list[str]:
    """File names, so that the same recordings in another folder give the same dataset."""
    counts = Counter(path.name for path in files)
    return [path.name if counts[path.name] == 1 else os.fspath(path) for path in files]
