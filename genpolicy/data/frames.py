"""Frames of a dataset, and the windows over them that a policy is trained on."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


@dataclass(frozen=True)
class Frames:
    """All frames, one array per column.

    Attributes:
        episode: Row of `Dataset.episodes` that each frame belongs to. Shape (N,).
        index: Number of the action in its episode. Shape (N,).
        event_time_s: When the action was commanded, s. Shape (N,).
        observation: Shape (N, D_o).
        action: Shape (N, D_a).
        phase: Shape (N,).
        stream_event_time_s: Event time of the sample used, by stream, s. Shape (N,) each.
        stream_receive_time_s: Its receive time, by stream, s. Shape (N,) each.
    """

    episode: Indices
    index: Indices
    event_time_s: Array
    observation: Array
    action: Array
    phase: NDArray[np.str_]
    stream_event_time_s: dict[str, Array]
    stream_receive_time_s: dict[str, Array]

    def __len__(self) -> int:
        return len(self.index)

    def rows(self, keep: Indices) -> "Frames":
        """The frames at `keep`."""
        return Frames(
            episode=self.episode[keep],
            index=self.index[keep],
            event_time_s=self.event_time_s[keep],
            observation=self.observation[keep],
            action=self.action[keep],
            phase=self.phase[keep],
            stream_event_time_s={k: v[keep] for k, v in self.stream_event_time_s.items()},
            stream_receive_time_s={k: v[keep] for k, v in self.stream_receive_time_s.items()},
        )


class Windows(NamedTuple):
    """Training examples: what conditions an invocation and the chunk that followed.

    Attributes:
        observations: Oldest first. Shape (M, H_o, D_o).
        actions: Row 0 is commanded at the tick of the newest observation. Shape (M, K, D_a).
        is_pad: Action repeated after the end of its episode. Shape (M, K).
        episode: Row of `Dataset.episodes`. Shape (M,).
        index: Number of the newest observation in its episode. Shape (M,).
    """

    observations: Array
    actions: Array
    is_pad: NDArray[np.bool_]
    episode: Indices
    index: Indices  # type: ignore[assignment]  # shadows tuple.index on purpose
