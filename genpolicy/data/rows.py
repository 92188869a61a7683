"""Rows of a dataset's two tables; as everywhere, a column is spelled here."""

from dataclasses import dataclass
from typing import ClassVar


@dataclass(frozen=True)
class EpisodeRow:
    """`episodes.parquet`: one accepted episode, in the order of the frames.

    Attributes:
        episode_uuid: Lower-case UUID.
        split: Split that it belongs to.
        task: Recorded task; this and the next four empty where not recorded.
        object: Recorded object.
        operator: Recorded operator.
        calibration_epoch: Recorded calibration epoch.
        outcome: Recorded outcome.
        is_recovery: Whether it was disturbed; None where not recorded.
        is_intervention: Whether a person took over; None where not recorded.
        source_file: Name of the recording.
        source_sha256: Hash of its bytes.
        content_sha256: Hash of its samples.
        rows: Its frames.
        lead_rows: Commands before the first frame.
        recorded_at_s: When it began.
        lead_action: Those commands, D_a numbers each.
        scene_start: JSON text of the start, for replay; empty where not recorded.
    """

    episode_uuid: str
    split: str
    task: str
    object: str
    operator: str
    calibration_epoch: str
    outcome: str
    is_recovery: bool | None
    is_intervention: bool | None
    source_file: str
    source_sha256: str
    content_sha256: str
    rows: int
    lead_rows: int
    recorded_at_s: float
    lead_action: tuple[tuple[float, ...], ...]
    scene_start: str


@dataclass(frozen=True)
class FrameRow:
    """`frames.parquet`: one action of an episode; read by column, never as objects.

    Attributes:
        episode_uuid: The episode.
        index: Number of the action in it.
        event_time_s: When the action was commanded.
        observation: D_o numbers.
        action: D_a numbers.
        phase: Task phase.
    """

    FAMILIES: ClassVar[tuple[str, ...]] = ("receive_time_s.", "event_time_s.")
    """Two columns more for every stream."""

    episode_uuid: str
    index: int
    event_time_s: float
    observation: tuple[float, ...]
    action: tuple[float, ...]
    phase: str
