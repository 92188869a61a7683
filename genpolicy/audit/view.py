"""The audit's view of an ingested dataset: which columns pair, how far apart is far."""

from typing import Any, NoReturn

import numpy as np

from genpolicy.audit.candidates import with_candidates
from genpolicy.audit.data import (
    NOT_RECORDED,
    Array,
    AuditInput,
    Episodes,
    Index,
    Integers,
    Text,
    canonical,
)
from genpolicy.audit.forms import Forms, forms_of
from genpolicy.audit.settings import AuditSettings
from genpolicy.audit.stored import places
from genpolicy.contract.action import ACTION_COMPONENTS, POSITION, ROTATION
from genpolicy.contract.observation import Channel, ObservationContract
from genpolicy.data.dataset import Dataset
from genpolicy.errors import ContractError


def from_dataset(
    dataset: Dataset, *, contract: ObservationContract, settings: AuditSettings, period_s: float
) -> AuditInput:
    """The audit's view of an ingested dataset.

    Args:
        dataset: A verified dataset.
        contract: The observation contract of the task.
        settings: Names of channels and scales.
        period_s: Action period, s.

    Raises:
        ContractError: A channel or component that the settings name does not exist, or rows do
            not fit.
    """
    frames, table, slices = dataset.frames, dataset.episodes, contract.slices
    named = (settings.position_channel, settings.reference_channel, *settings.context_channels)
    for name in (*named, *settings.channel_scale):
        if name is not None and name not in slices:
            _refuse(f"naming the channel {name}", f"one of {', '.join(slices)}")
    observed, commanded, stream = _pairing(dataset, contract, settings)
    episodes = _episodes(table, frames.event_time_s, frames.episode)
    data = canonical(
        AuditInput(
            observation=frames.observation,
            action=frames.action,
            phase=frames.phase,
            episode=frames.episode,
            index=frames.index,
            event_time_s=frames.event_time_s,
            episodes=episodes,
            observation_scale=scales(contract, settings),
            observation_names=contract.component_names,
            action_names=tuple(dataset.manifest["action_contract"]["components"]),
            observation_position=observed,
            action_position=commanded,
            action_rotation=_rotation(dataset, commanded),
            action_gripper=_gripper(dataset, commanded),
            period_s=period_s,
            delay_s={
                name: received - frames.stream_event_time_s[name]
                for name, received in frames.stream_receive_time_s.items()
                if name in contract.streams
            },
            stream_time_s={
                name: stamps
                for name, stamps in frames.stream_event_time_s.items()
                if name in contract.streams
            },
            position_stream=stream,
            reference=slices.get(settings.reference_channel or ""),
            context={name: slices[name] for name in settings.context_channels},
            streams=_streams(contract),
            paired=len(np.arange(contract.dim)[observed]) > 0,
            phase_observed=settings.phase_observed,
            forms=_forms(dataset, settings, observed, commanded),
            stored=_stored(table, episodes),
        )
    )
    return with_candidates(data, table, dataset.manifest)


def scales(contract: ObservationContract, settings: AuditSettings) -> Array:
    """Difference of each observation component that makes another observation. Shape (D_o,)."""
    result: list[float] = []
    for channel in contract.channels:
        result += [_scale(channel, part, settings) for part in channel.components]
    return np.asarray(result, dtype=np.float64)


def _pairing(
    dataset: Dataset, contract: ObservationContract, settings: AuditSettings
) -> tuple[Index, Index, str]:
    """Columns of the observed position, of what is commanded of it, and the observed stream."""
    names = list(contract.component_names)
    columns = list(dataset.manifest["action_contract"]["components"])
    streams = [channel.stream for channel in contract.channels for _ in channel.components]
    if settings.position_components is not None:
        wanted = settings.position_components
    elif settings.position_channel is not None:
        wanted = names[contract.slices[settings.position_channel]]
    else:
        wanted = []
    chosen = settings.action_components
    if chosen is None:
        chosen = columns[: len(wanted)] if wanted else columns
    for name, known in [(n, names) for n in wanted] + [(n, columns) for n in chosen]:
        if name not in known:
            _refuse(f"naming the component {name}", f"one of {', '.join(known)}")
    if wanted and len(wanted) != len(chosen):
        _refuse(
            f"pairing {len(wanted)} observed with {len(chosen)} commanded components",
            "one commanded component for each observed one",
        )
    observed = _columns([names.index(name) for name in wanted])
    commanded = _columns([columns.index(name) for name in chosen])
    stream = streams[names.index(wanted[0])] if wanted else contract.streams[0]
    return observed, commanded, stream


def _forms(
    dataset: Dataset, settings: AuditSettings, observed: Index, commanded: Index
) -> Forms | None:
    """What the numbers of the action mean, and which observed column each of them moves."""
    names = list(dataset.manifest["action_contract"]["components"])
    seen = np.arange(dataset.frames.observation.shape[1])[observed].tolist()
    told = np.asarray(names)[commanded].tolist() if seen else []
    return forms_of(settings, names, dict(zip(told, seen, strict=True)))


def _streams(contract: ObservationContract) -> dict[str, Index]:
    """Columns of each stream."""
    owners = [channel.stream for channel in contract.channels for _ in channel.components]
    return {
        name: _columns([column for column, owner in enumerate(owners) if owner == name])
        for name in contract.streams
    }


def _columns(numbers: list[int]) -> Index:
    """A slice where the columns lie side by side: it copies nothing."""
    if numbers and numbers == list(range(numbers[0], numbers[0] + len(numbers))):
        return slice(numbers[0], numbers[-1] + 1)
    return np.asarray(numbers, dtype=np.int64)


def _rotation(dataset: Dataset, commanded: Index) -> slice | None:
    """Where the rotation lies, in the action contract of tool poses; None in any other."""
    names = list(dataset.manifest["action_contract"]["components"])
    whole = set(range(POSITION.start, POSITION.stop)) <= set(np.arange(len(names))[commanded])
    return ROTATION if whole and names[ROTATION] == list(ACTION_COMPONENTS[ROTATION]) else None


def _gripper(dataset: Dataset, commanded: Index) -> Index | None:
    """Columns that name a gripper and are no part of the position; None where there is none."""
    names = list(dataset.manifest["action_contract"]["components"])
    taken = set(np.arange(len(names))[commanded].tolist())
    found = [k for k, name in enumerate(names) if "gripper" in name.lower() and k not in taken]
    return _columns(found) if found else None


def _scale(channel: Channel, component: str, settings: AuditSettings) -> float:
    if channel.name in settings.ignored_channels:
        return float("inf")
    if channel.name in settings.channel_scale:
        return settings.channel_scale[channel.name]
    rules = (
        ("m", "_m", settings.scale_m),
        ("px", "_px", settings.scale_px),
        ("rad", "_rad", settings.scale_rad),
        ("N", "_n", settings.scale_n),
    )
    for unit, ending, scale in rules:
        if channel.unit == unit or component.endswith(ending):
            return scale
    return settings.scale_unit


def _episodes(table: Any, event_time_s: Array, episode: Integers) -> Episodes:
    n = len(table)

    def text(name: str) -> Text:
        values = table[name] if name in table else [""] * n
        return np.asarray(["" if _missing(value) else str(value) for value in values], dtype=str)

    if "recorded_at_s" in table:
        starts = np.asarray(table["recorded_at_s"], dtype=np.float64)
    else:
        starts = np.full(n, np.inf)
        np.minimum.at(starts, episode, event_time_s)
    # Recordings that all start at the same time have no known order.
    distinct = len(np.unique(starts)) == n and n > 1
    order = np.argsort(np.argsort(starts)).astype(np.float64) if distinct else np.full(n, np.nan)
    flags = table["is_recovery"] if "is_recovery" in table else [False] * n
    return Episodes(
        uuid=text("episode_uuid"),
        split=text("split"),
        operator=text("operator"),
        object=text("object"),
        calibration_epoch=text("calibration_epoch"),
        outcome=text("outcome"),
        is_recovery=np.asarray([flag is not None and flag == 1 for flag in flags], dtype=bool),
        order=order,
    )


def _stored(table: Any, episodes: Episodes) -> Array | None:
    """Places in the files, where nothing says when each episode was recorded."""
    if "source_file" not in table or bool(np.all(np.isfinite(episodes.order))):
        return None
    return places(str(text) for text in table["source_file"])


def _missing(value: object) -> bool:
    blank = isinstance(value, float) and np.isnan(value)
    return value is None or blank or str(value).strip().lower() in NOT_RECORDED


def _refuse(found: str, expected: str) -> NoReturn:
    raise ContractError(
        where="params: audit",
        found=found,
        expected=expected,
        action="Name channels and components of the dataset's contracts.",
    )
