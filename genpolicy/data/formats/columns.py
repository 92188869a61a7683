"""Which columns are labels and clocks, told by their names."""

from collections.abc import Iterable

from genpolicy.data.formats.contract import Labels
from genpolicy.data.formats.source import Column

NAMES: dict[str, tuple[str, ...]] = {
    "episode": (
        *("episode_uuid", "episode_index", "episode_id", "episode", "episode_idx", "demo_id"),
        *("demo", "trajectory_id", "trajectory", "traj_id", "traj", "run_id", "run"),
    ),
    "frame": ("frame_index", "frame", "frame_id", "step_index", "step", "index"),
    "time": (
        *("timestamp", "time_s", "timestamp_s", "event_time_s", "time", "t", "stamp"),
        *("timestamp_ns", "time_ns", "timestamp_us", "time_us", "timestamp_ms", "time_ms"),
    ),
    "task": ("task", "task_name", "language_instruction", "instruction"),
    "phase": ("phase", "stage", "subtask", "subtask_index", "skill"),
    "object": ("object_name", "object_id", "object_class"),
    "operator": ("operator", "operator_id", "demonstrator", "teleoperator", "user_id"),
    "calibration_epoch": ("calibration_epoch", "calibration", "calibration_id"),
    "outcome": ("outcome", "success", "is_success", "succeeded", "is_episode_successful"),
    "is_recovery": ("is_recovery", "recovery"),
    "is_intervention": (
        *("is_intervention", "intervention", "complementary_info.is_intervention"),
        *("intervened", "human_intervention", "takeover"),
    ),
}
GUESSED = ("intervened", "human_intervention", "takeover")
"""Names of interventions that may say something else, an arm that was taken over for one."""
BOOKKEEPING = {
    *("index", "reward", "rewards", "done", "dones", "terminated", "truncated", "success", "id"),
    *("episode", "frame", "step", "timestamp", "time", "next", "task", "mask", "discount"),
}


def labels_of(columns: Iterable[Column], **stated: str | None) -> Labels:
    """The labels whose column's name says what it is; what the layout states comes first.

    Args:
        columns: The columns.
        stated: Column of a label, or None, where the layout defines it.
    """
    names = {column.name.lower(): column.name for column in columns if column.width is None}
    found: dict[str, str | None] = {}
    for label, candidates in NAMES.items():
        known = [names[candidate] for candidate in candidates if candidate in names]
        found[label] = known[0] if known else None
    return Labels(**{**found, **stated})
