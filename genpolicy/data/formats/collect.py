"""From recordings and a contract to a dataset: every episode accepted, or refused by name."""

from collections.abc import Iterator
from pathlib import Path
from typing import NoReturn

from genpolicy.data.assemble import AcceptedEpisode, Description, Refusal, write_dataset
from genpolicy.data.contract import SplitRule
from genpolicy.data.formats.accept import PHASE_ALL, accept, wanted_columns
from genpolicy.data.formats.contract import ImportContract, selectors
from genpolicy.data.formats.open_questions import open_questions
from genpolicy.data.formats.recorded import Reasons
from genpolicy.data.formats.result import Opened
from genpolicy.data.formats.source import Column, Progress, Source, refusal_of, refuse
from genpolicy.data.variables import completed
from genpolicy.errors import BadInputError, ConfigError

SOURCE_KINDS = {"zarr": "zarr_replay_buffer"}
CLOCK_ROWS = "no clock was recorded: event and receive time are row / rate; "
PLACED = "recording time is the place of the episodes in the recordings, as the contract says"
UNPLACED = "which episode was recorded before which is not known, and splits go by their samples"
CLOCK_COLUMN = (
    "event and receive time are both the recorded time of the row; when each sensor was exposed "
    "was not recorded"
)


def import_source(
    source: Source,
    contract: ImportContract,
    *,
    out: Path,
    split: SplitRule,
    progress: Progress | None = None,
) -> Opened:
    """Accept or refuse each episode and write the dataset; holds one raw episode at a time.

    Args:
        source: The recordings.
        contract: How to read them.
        out: The dataset folder; whole or not at all, an old one is replaced.
        split: Shares of the splits in the order of recording.
        progress: Called with episodes done and, where known, how many there are.

    Raises:
        BadInputError: A column of the contract is missing, or too few episodes were accepted.
    """
    _check_known(source, contract)
    accepted: list[AcceptedEpisode] = []
    refused: list[Refusal] = []
    seen: dict[str, str] = {}
    reasons = Reasons(contract)
    for outcome in _outcomes(source, contract, seen, reasons):
        if isinstance(outcome, Refusal):
            refused.append(outcome)
        else:
            accepted.append(outcome)
        if progress is not None:
            progress(len(accepted) + len(refused), source.count)
    phases = contract.phases or sorted({str(p) for e in accepted for p in set(e.rows.phase)})
    stated = [*contract.notes, *source.notes, *open_questions(contract)]
    notes = tuple(dict.fromkeys([*stated, *reasons.notes(source.columns)]))
    description = Description(
        source_kind=SOURCE_KINDS.get(contract.format, contract.format),
        observation=contract.observation,
        action=contract.action_contract,
        phases=tuple(phases) or (PHASE_ALL,),
        action_period_s=contract.period_s,
        split=split,
        clock_note=_clock_note(contract),
        notes=notes,
        import_contract=contract.model_dump(mode="json"),
    )
    found = len(accepted) + len(refused)
    with completed(out, reasons.recorded()) as folder:
        write_dataset(
            folder, accepted=accepted, refused=refused, found=found, description=description
        )
    return Opened(out, contract, found, len(accepted), tuple(refused), notes)


def _clock_note(contract: ImportContract) -> str:
    if contract.labels.time is not None:
        return CLOCK_COLUMN
    return CLOCK_ROWS + (PLACED if contract.time_origin == "recording" else UNPLACED)


def _outcomes(
    source: Source, contract: ImportContract, seen: dict[str, str], reasons: Reasons
) -> Iterator[AcceptedEpisode | Refusal]:
    wanted, episode_column = wanted_columns(contract), contract.labels.episode
    for raw in source.episodes(wanted, episode_column, also=reasons.wants):
        if isinstance(raw, Refusal):
            yield raw
            continue
        try:
            episode = accept(raw, contract)
            for key in (episode.content_sha256, episode.episode_uuid):
                if key in seen:
                    what = "the samples" if key == episode.content_sha256 else "the episode_uuid"
                    refuse(raw.label, f"{what} of {seen[key]} again", "every episode once")
            seen[episode.content_sha256] = seen[episode.episode_uuid] = raw.label
            reasons.add(raw, episode.episode_uuid)
            yield episode
        except BadInputError as error:
            yield refusal_of(raw.label, error)


def _check_known(source: Source, contract: ImportContract) -> None:
    """Every column that the contract names exists and is wide enough, before anything is read."""
    known = {column.name: column for column in source.columns}
    texts = [text for channel in contract.channels for text in channel.columns]
    for selector in selectors([*texts, *contract.action.columns], where="contract"):
        column = known.get(selector.column)
        if column is None:
            _unfit(selector.column, f"not in {source.name}", f"one of {_names(known)}")
        if column.kind != "number" or column.per_episode:
            _unfit(selector.column, "not numbers per row", "a numeric column")
        width = column.width
        if selector.element is None and width is not None:
            _unfit(selector.column, f"{width} numbers wide", "chosen as name[i] or name[i:j]")
        if selector.element is not None and selector.element >= (width or 1):
            _unfit(selector.column, f"{width or 1} numbers wide", f"element {selector.element}")
    for label, name in contract.labels.named().items():
        if name not in known:
            _unfit(name, f"not in {source.name} (label {label})", f"one of {_names(known)}")


def _names(known: dict[str, Column]) -> str:
    return ", ".join(sorted(known))[:400]


def _unfit(column: str, found: str, expected: str) -> NoReturn:
    raise ConfigError(
        where=f"contract: column {column}",
        found=found,
        expected=expected,
        action="Correct the contract, or let `genpolicy propose` write a new one.",
    )
