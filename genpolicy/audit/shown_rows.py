"""Rows that only a person looks at: figures show them, nothing is decided by them."""

from dataclasses import dataclass


@dataclass(frozen=True)
class ExampleChunk:
    """`examples.parquet`: one demonstration's chunk in one example situation.

    Attributes:
        example: Number of the situation.
        phase: Task phase.
        two_mode: Whether the situation counts as one with several modes.
        query_uuid: Held-out episode that asked.
        query_index: Its row.
        episode_uuid: Episode of this chunk.
        is_query: Whether it is the one that asked.
        distance: How far its observation lies from the query's, in scales.
        cluster: Mode, 0 the largest.
        coordinate: Where the chunk lies along the direction in which the chunks differ most
            between clusters, RMS distance in the unit of the component.
        path: Commanded positions, moved to the query's place. K times P numbers.
    """

    example: int
    phase: str
    two_mode: bool
    query_uuid: str
    query_index: int
    episode_uuid: str
    is_query: bool
    distance: float
    cluster: int
    coordinate: float
    path: tuple[float, ...]


@dataclass(frozen=True)
class Alignment:
    """`alignment.parquet`: clock of one episode against the others.

    Attributes:
        episode_uuid: The episode.
        epoch: Calibration epoch.
        order: Rank of the recording; by identifier where no order was recorded.
        lag_rows: Action-to-state lag; None where it cannot be measured, as for what follows.
        offset_before_s: Its deviation from the median lag.
        offset_after_s: The same on realigned data.
    """

    episode_uuid: str
    epoch: str
    order: float
    lag_rows: float | None
    offset_before_s: float | None
    offset_after_s: float | None


@dataclass(frozen=True)
class SupportPoint:
    """`support.parquet`: one query, and whether the training episodes reach there.

    Attributes:
        phase: Task phase.
        episode_uuid: Held-out episode that asks.
        index: Its row.
        analysed: Whether enough training episodes came near.
        two_mode: Whether several modes were found.
        position: Observed position. P numbers.
    """

    phase: str
    episode_uuid: str
    index: int
    analysed: bool
    two_mode: bool
    position: tuple[float, ...]
