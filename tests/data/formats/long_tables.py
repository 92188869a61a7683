"""Rows of long tables, as other recorders write them."""

import numpy as np
import pyarrow as pa

UUIDS = [f"00000000-0000-4000-8000-{i:012d}" for i in range(8)]


def rows(layouts, number, **changes):
    """One episode of scalar columns, as a person's own recorder writes them."""
    state, action = layouts.samples(number)
    plain = {
        "episode_uuid": [UUIDS[number]] * 30,
        "timestamp": 100.0 * number + np.arange(30) / 20,
        "step": np.arange(30),
        "tool_x_m": state[:, 0],
        "tool_y_m": state[:, 1],
        "load_n": 3.0 * state[:, 2],
        "action_tool_x_m": action[:, 0],
        "action_tool_y_m": action[:, 1],
        "operator": [f"op{number % 2}"] * 30,
        "success": [number != 4] * 30,
        "phase": ["reach"] * 20 + ["hold"] * 10,
        "reward": np.zeros(30),
        "picture": [b"jpeg"] * 30,
    }
    return pa.table({**plain, **changes})
