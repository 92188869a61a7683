"""The planar recording as a table of raw columns, its action written in the forms people use."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from genpolicy.audit import audit, propose_settings
from genpolicy.data.dataset import load_dataset
from genpolicy.data.formats import open_dataset

RATE_HZ = 10.0
STATE = ("state_x", "state_y")


def forms(data):
    """The commanded places of canonical planar data in each form. Shapes (N, 2)."""
    target, seen = data.action, data.observation[:, :2]
    first = np.diff(data.episode, prepend=-1) != 0
    step = np.where(first[:, None], target - seen, np.diff(target, axis=0, prepend=target[:1]))
    low, high = target.min(axis=0), target.max(axis=0)
    return {
        "absolute": target,
        "from_observed": target - seen,
        "delta": step,
        "velocity": step * RATE_HZ,
        "normalised_delta": step / np.abs(step).max(),
        "normalised_place": 2.0 * (target - low) / (high - low) - 1.0,
    }


def write(path, data, action, *, names=("action_x", "action_y"), state=STATE, extra=None):
    """A long table: state, goal, lamp, action, time and outcome."""
    table = {
        "episode_index": data.episode,
        "timestamp": data.event_time_s,
        **{name: data.observation[:, k] for k, name in enumerate(state)},
        "goal_x": data.observation[:, 2],
        "goal_y": data.observation[:, 3],
        "lamp": data.observation[:, 4],
        **{name: action[:, k] for k, name in enumerate(names)},
        "outcome": np.where(data.episodes.outcome == "", "none", data.episodes.outcome)[
            data.episode
        ],
        **(extra or {}),
    }
    pq.write_table(pa.table(table), path)
    return path


def audited_table(path, folder, **overrides):
    """What `genpolicy audit` does of a table: proposed, imported, audited."""
    opened = open_dataset(path, out=folder / f"{path.stem}_dataset")
    dataset = load_dataset(opened.folder)
    settings = propose_settings(dataset, {"query_stride": 4, "permutations": 199, **overrides})
    return opened, audit(dataset, settings)
