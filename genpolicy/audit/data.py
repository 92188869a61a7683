"""What the audit looks at: one table of rows, one of episodes, and how far apart is far.

Everything is put into one order first (episodes by identifier, rows by index), so that the
order in which episodes arrive can change no number.
"""

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from genpolicy.audit.angles import without_jumps
from genpolicy.audit.forms import Forms, before, in_place
from genpolicy.audit.variable import Variable
from genpolicy.errors import ContractError, NonFiniteError

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
Text = NDArray[np.str_]
Flags = NDArray[np.bool_]
Index = slice | Integers

ACROSS_PHASES = "any"
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
        action: As recorded. Shape (N, D_a).
        phase: Shape (N,).
        episode: Position in `episodes`. Shape (N,).
        index: Row of its episode. Shape (N,).
        event_time_s: Time of the row. Shape (N,).
        episodes: The episodes.
        observation_scale: Difference that makes another observation; inf ignores. Shape (D_o,).
        observation_names: Name of each component. Length D_o.
        observation_position: Where the TCP position (or the joint angles) lies in the observation.
        action_position: Where what is commanded of it lies in the action, component by component.
        action_rotation: Where the six-number rotation lies in the action, if there is one.
        action_gripper: Where the opening of the gripper lies in the action, if there is one.
        period_s: Action period.
        delay_s: Receive time minus event time of the sample used, per stream. Shape (N,).
        stream_time_s: Event time of the sample used, per stream, on any clock. Shape (N,).
        position_stream: Stream that delivers the observed position.
        reference: Where the pose of reference begins with its position, if there is one.
        context: Observed channels that are held against the modes.
        streams: Columns of each stream in the observation.
        paired: Whether the action commands something observed. If not (a leader arm of another
            build), there is no lag, and a chunk is taken relative to its own first action.
        phase_observed: Whether a policy sees the phase.
        forms: What the numbers of the action mean; None where all are plain places.
        variables: Other recorded columns that may be why demonstrations differ.
        left_out: Recorded columns that cannot be, with the reason.
        phase_name: What the recordings call the phase.
        stored: Place of each episode in the files, where no clock gives an order; else None. Shape
            (E,).
        action_names: Name of each number of the action; none where they have no names. Length D_a.
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
    observation_position: Index
    action_position: Index
    period_s: float
    action_rotation: slice | None = None
    action_gripper: Index | None = None
    delay_s: dict[str, Array] = field(default_factory=dict)
    stream_time_s: dict[str, Array] = field(default_factory=dict)
    position_stream: str = "robot"
    reference: slice | None = None
    context: dict[str, slice] = field(default_factory=dict)
    streams: dict[str, Index] = field(default_factory=dict)
    paired: bool = True
    phase_observed: bool = True
    forms: Forms | None = None
    variables: tuple[Variable, ...] = ()
    left_out: tuple[tuple[str, str], ...] = ()
    phase_name: str = "phase"
    stored: Array | None = None
    action_names: tuple[str, ...] = ()

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
        """Observed TCP position, or joint angles. Shape (N, P); (N, 0) where nothing pairs."""
        return self.observation[:, self.observation_position]

    @property
    def commanded(self) -> Array:
        """What is commanded of the position, as places. Shape (N, P)."""
        return self.placed[:, self.action_position]

    @cached_property
    def placed(self) -> Array:
        """The action with every number as a place (canonical order). Shape (N, D_a)."""
        action = self.action
        if self.forms is not None:
            action = in_place(action, self.observation, self.episode, self.forms)
        return without_jumps(action, self.episode, self._alone)

    @property
    def _alone(self) -> Integers:
        """Places that no observed number is held against: angles among them may jump."""
        columns = np.arange(self.action.shape[1])
        alone = np.ones(len(columns), dtype=bool)
        if self.paired:
            alone[self.action_position] = False
        if self.action_rotation is not None:
            alone[self.action_rotation] = False
        if self.forms is not None:
            alone &= ~self.forms.added
        return np.asarray(columns[alone])

    @property
    def grouping(self) -> Text:
        """Inside of which situations are looked for: the phase, if a policy sees it. Shape (N,)."""
        return self.phase if self.phase_observed else np.full(len(self.phase), ACROSS_PHASES)

    @cached_property
    def last_row(self) -> Integers:
        """Last row of the episode of each row (canonical order). Shape (N,)."""
        ends = np.searchsorted(self.episode, np.arange(len(self.episodes)), side="right") - 1
        return np.asarray(ends[self.episode], dtype=np.int64)

    @cached_property
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
        stream_time_s={name: item[rows] for name, item in sorted(data.stream_time_s.items())},
        variables=tuple(item.reordered(rows, order) for item in data.variables),
        stored=None if data.stored is None else data.stored[order],
        episodes=Episodes(
            **{name: getattr(table, name)[order] for name in Episodes.__dataclass_fields__}
        ),
    )


def chunk_rows(data: AuditInput, rows: Integers, steps: int) -> Integers:
    """Rows of the chunks that begin at `rows`, the last row repeated. Shape (n, steps)."""
    ends = data.last_row[rows][:, None]
    return np.asarray(np.minimum(rows[:, None] + np.arange(steps), ends), dtype=np.int64)


def relative_paths(data: AuditInput, rows: Integers, steps: int) -> Array:
    """Commanded positions of the chunks at `rows`, from their origin there.

    Returns:
        Shape (n, steps, P).
    """
    commanded = data.placed[chunk_rows(data, rows, steps)][..., data.action_position]
    begin = origin(data, rows)
    if data.forms is not None:
        columns = np.arange(data.action.shape[1])[data.action_position]
        begin = np.where(data.forms.added[columns], before(data, columns, rows), begin)
    return np.asarray(commanded - begin[:, None, :])


def origin(data: AuditInput, rows: Integers) -> Array:
    """Where chunks at `rows` begin: the observed position, or the first command if none pairs.

    Of what is added up without a partner, where it stood before.

    Returns:
        Shape (n, P).
    """
    if data.paired:
        return np.asarray(data.observation[rows][:, data.observation_position])
    first = np.asarray(data.placed[rows][:, data.action_position])
    if data.forms is None:
        return first
    columns = np.arange(data.action.shape[1])[data.action_position]
    return np.where(data.forms.added[columns], before(data, columns, rows), first)


def commanded_path(data: AuditInput, actions: Array, row: int) -> Array:
    """Where a chunk of recorded numbers, sent at `row`, commands the position to be.

    Args:
        data: Canonical audit input.
        actions: Shape (K, D_a).
        row: Row that it is sent at.

    Returns:
        Shape (K, P).
    """
    columns = np.arange(data.action.shape[1])[data.action_position]
    chosen = actions[:, columns]
    if data.forms is None:
        return np.asarray(chosen)
    added = data.forms.added[columns]
    moved = chosen * data.forms.gain[columns] + np.where(added, 0.0, data.forms.offset[columns])
    begin = origin(data, np.array([row], dtype=np.int64))
    return np.where(added, begin + np.cumsum(moved, axis=0), moved)


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
