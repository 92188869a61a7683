"""The table that a training leaves of its validation loss, apart from what a training imports."""

from dataclasses import dataclass

VALIDATION_FILE = "validation.parquet"
EARLIER_FOLDER = "three_quarters"
"""Folder in a checkpoint's with the averaged weights as they were at three quarters."""


@dataclass(frozen=True)
class ValidationRow:
    """`validation.parquet` of a checkpoint: loss of the averaged weights on a held-out episode.

    Attributes:
        updates: Updates so far.
        episode_uuid: The episode.
        windows: Windows of it, at equal distances.
        loss: Mean loss over them; each method has its own loss.
    """

    updates: int
    episode_uuid: str
    windows: int
    loss: float


def three_quarters(updates: int) -> int:
    """The update with which the last quarter of a training begins."""
    return updates - updates // 4
