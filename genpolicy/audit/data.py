"""What the audit looks at: one table of rows, one of episodes, and how far apart is far.

Everything is put into one order first (episodes by identifier, rows by index), so that the
order in which episodes arrive can change no number.
"""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from genpolicy.audit.settings import AuditSettings
from genpolicy.contract.action import POSITION, ROTATION
from genpolicy.contract.observation import Channel, ObservationContract
from genpolicy.dataset.dataset import Dataset
from genpolicy.errors import ContractError, NonFiniteError

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
Text = NDArray[np.str_]
Flags = NDArray[np.bool_]

NOT_RECORDED = ("", "not_recorded", "unknown", "none", "nan")


@dataclass(frozen=True)
class Episodes:
    """One entry per episode; arrays of shape (E,). Text that is not recorded is empty.

    Attributes:
        uuid: Identifier, unique.
        split: train, validation or test.
        operator: Who demonstrated.
        object: Which object.
        calibration_epoch: Under which calibration.
        outcome: Label, success or failure.
        is_recovery: Disturbed and recovered.
        order: Rank of the recording in time; NaN where not recorded.
    """

    uuid: Text
    split: Text
    operator: Text
    object: Text
    calibration_epoch: Text
    outcome: Text
    is_recovery: Flags
    order: Array

    def __len__(self) -> int:
        return len(self.uuid)


@dataclass(frozen=True)
class AuditInput:
    """Rows of all episodes and the scales of the observation.

    Attributes:
        observation: Shape (N, D_o).
        action: Shape (N, D_a).
        phase: Shape (N,).
        episode: Position in `episodes`. Shape (N,).
        index: Row of its episode. Shape (N,).
        event_time_s: Time of the row. Shape (N,).
        episodes: The episodes.
        observation_scale: Difference that makes another observation; inf ignores. Shape (D_o,).
        observation_names: Name of each component. Length D_o.
        observation_position: Where the TCP position lies in the observation.
        action_position: Where the TCP position lies in the action.
        action_rotation: Where the six-number rotation lies in the action, if there is one.
        period_s: Action period.
        delay_s: Receive time minus event time of the sample used, per stream. Shape (N,).
        position_stream: Stream that delivers the observed position.
        reference: Where the pose of reference begins with its position, if there is one.
        context: Observed channels that are held against the modes.
    """

    observation: Array
    action: Array
    phase: Text
    episode: Integers
    index: Integers
    event_time_s: Array
    episodes: Episodes
    observation_scale: Array
    observation_names: tuple[str, ...]
    observation_position: slice
    action_position: slice
    period_s: float
    action_rotation: slice | None = None
    delay_s: dict[str, Array] = field(default_factory=dict)
    position_stream: str = "robot"
    reference: slice | None = None
    context: dict[str, slice] = field(default_factory=dict)

    def __post_init__(self) -> None:
        n = len(self.observation)
        for name in ("action", "phase", "episode", "index", "event_time_s"):
            if len(getattr(self, name)) != n:
                raise ContractError(
                    where=f"audit input: {name}",
                    found=f"{len(getattr(self, name))} rows",
                    expected=f"{n}, as the observations",
                    action="Build all columns from the same frames.",
                )
        for name in ("observation", "action", "event_time_s"):
            if not np.all(np.isfinite(getattr(self, name))):
                raise NonFiniteError(
                    where=f"audit input: {name}",
                    found="with NaN or infinity",
                    expected="finite numbers",
                    action="Refuse the recording at ingest; never fill it.",
                )
        if len(np.unique(self.episodes.uuid)) != len(self.episodes):
            raise ContractError(
                where="audit input: episodes",
                found="with one identifier twice",
                expected="unique identifiers",
                action="Ingest each recording once.",
            )

    @property
    def position(self) -> Array:
        """Observed TCP position. Shape (N, P)."""
        return self.observation[:, self.observation_position]

    @property
    def last_row(self) -> Integers:
        """Last row of the episode of each row (canonical order). Shape (N,)."""
        ends = np.searchsorted(self.episode, np.arange(len(self.episodes)), side="right") - 1
        return np.asarray(ends[self.episode], dtype=np.int64)

    @property
    def first_row(self) -> Integers:
        """First row of the episode of each row (canonical order). Shape (N,)."""
        return np.asarray(np.searchsorted(self.episode, self.episode), dtype=np.int64)


def canonical(data: AuditInput) -> AuditInput:
    """The same data with episodes in order of identifier and rows in order of index."""
    order = np.argsort(data.episodes.uuid, kind="stable")
    rank = np.empty(len(order), dtype=np.int64)
    rank[order] = np.arange(len(order))
    episode = rank[data.episode]
    rows = np.lexsort((data.index, episode))
    table = data.episodes
    return replace(
        data,
        observation=np.asarray(data.observation[rows], dtype=np.float64),
        action=np.asarray(data.action[rows], dtype=np.float64),
        phase=data.phase[rows],
        episode=episode[rows],
        index=np.asarray(data.index[rows], dtype=np.int64),
        event_time_s=data.event_time_s[rows],
        delay_s={name: values[rows] for name, values in sorted(data.delay_s.items())},
        episodes=Episodes(
            **{name: getattr(table, name)[order] for name in Episodes.__dataclass_fields__}
        ),
    )


def chunk_rows(data: AuditInput, rows: Integers, steps: int) -> Integers:
    """Rows of the chunks that begin at `rows`, the last row repeated. Shape (n, steps)."""
    ends = data.last_row[rows][:, None]
    return np.asarray(np.minimum(rows[:, None] + np.arange(steps), ends), dtype=np.int64)


def relative_paths(data: AuditInput, rows: Integers, steps: int) -> Array:
    """Commanded positions of the chunks at `rows`, from the observed position there.

    Returns:
        Shape (n, steps, P).
    """
    commanded = data.action[chunk_rows(data, rows, steps)][:, :, data.action_position]
    return np.asarray(commanded - data.position[rows][:, None, :])


def observation_history(data: AuditInput, rows: Integers, horizon: int) -> Array:
    """Scaled observations of the last `horizon` rows; components without scale left out.

    Returns:
        Shape (n, horizon * used components), newest first.
    """
    used = np.isfinite(data.observation_scale)
    first = data.first_row[rows]
    parts = [
        data.observation[np.maximum(rows - back, first)][:, used] / data.observation_scale[used]
        for back in range(horizon)
    ]
    return np.concatenate(parts, axis=1)


def recorded(values: Text) -> bool:
    """Whether a text variable was recorded in at least one episode."""
    return any(str(value).strip().lower() not in NOT_RECORDED for value in values)


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
        ContractError: A channel that the settings name does not exist, or rows do not fit.
    """
    frames, table = dataset.frames, dataset.episodes
    for name in (settings.position_channel, settings.reference_channel, *settings.context_channels):
        if name is not None and name not in contract.slices:
            raise ContractError(
                where="params: audit",
                found=f"naming the channel {name}",
                expected=f"one of {', '.join(contract.slices)}",
                action="Name channels of the observation contract.",
            )
    slices = contract.slices
    position = slices[settings.position_channel]
    streams = {channel.name: channel.stream for channel in contract.channels}
    return canonical(
        AuditInput(
            observation=frames.observation,
            action=frames.action,
            phase=frames.phase,
            episode=frames.episode,
            index=frames.index,
            event_time_s=frames.event_time_s,
            episodes=_episodes(table, frames.event_time_s, frames.episode),
            observation_scale=scales(contract, settings),
            observation_names=contract.component_names,
            observation_position=position,
            action_position=slice(0, position.stop - position.start),
            action_rotation=ROTATION if position.stop - position.start == POSITION.stop else None,
            period_s=period_s,
            delay_s={
                name: received - frames.stream_event_time_s[name]
                for name, received in frames.stream_receive_time_s.items()
                if name in contract.streams
            },
            position_stream=streams[settings.position_channel],
            reference=slices.get(settings.reference_channel or ""),
            context={name: slices[name] for name in settings.context_channels},
        )
    )


def scales(contract: ObservationContract, settings: AuditSettings) -> Array:
    """Difference of each observation component that makes another observation. Shape (D_o,)."""
    result: list[float] = []
    for channel in contract.channels:
        result += [_scale(channel, part, settings) for part in channel.components]
    return np.asarray(result, dtype=np.float64)


def _scale(channel: Channel, component: str, settings: AuditSettings) -> float:
    if channel.name in settings.ignored_channels:
        return float("inf")
    if component.endswith("_m") or channel.unit == "m":
        return settings.scale_m
    if channel.unit == "px":
        return settings.scale_px
    if component.endswith("_n") or channel.unit == "N":
        return settings.scale_n
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


def _missing(value: object) -> bool:
    blank = isinstance(value, float) and np.isnan(value)
    return value is None or blank or str(value).strip().lower() in NOT_RECORDED
