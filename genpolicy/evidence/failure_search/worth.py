"""How far a rollout was from failing, and how mild what it failed at was."""

from collections.abc import Mapping
from typing import Any

LEAST_OF_A_SUCCESS = 1e-6
"""Of one that had nothing left: far less than one action period of the longest rollout, and above
what a failure is worth at any size."""


def worth(
    rollout: Mapping[str, Any], *, share: float, episode_limit_s: float, force_limit_n: float
) -> float:
    """What the search makes small: above 0 of a success, at most 0 of a failure.

    Args:
        rollout: Columns of a `RolloutRow`: success, duration, largest force.
        share: Size of the disturbance as a share of the largest stated, in (0, 1]; 1 where the
            condition has none.
        episode_limit_s: Longest rollout, s.
        force_limit_n: Contact force that stops it, N.

    Returns:
        Of a success the share of the time or of the force that was left, whichever is less and
        `LEAST_OF_A_SUCCESS` at least, so that a search has a slope before it has found anything,
        and no success, however late, is taken for a failure; of a failure the share less one, so
        that a milder one is lower.
    """
    if not rollout["success"]:
        return share - 1.0
    time_left = 1.0 - float(rollout["duration_s"]) / episode_limit_s
    force_left = 1.0 - float(rollout["force_peak_n"]) / force_limit_n
    return max(min(time_left, force_left), LEAST_OF_A_SUCCESS)
