"""Frames of evidence for the figures."""

import numpy as np
import pandas as pd


def examples(width, clusters=2, members=12, steps=10):
    rng = np.random.default_rng(width)
    rows = []
    for number in range(2):
        for k in range(members):
            side = k % clusters
            path = np.cumsum(rng.normal(0, 0.01, (steps, width)), axis=0)
            path[:, 0] += 0.1 * side * np.arange(steps)
            rows.append(
                {
                    "example": number, "phase": "reach", "query_uuid": f"episode-{number}",
                    "query_index": 4, "is_query": k == 0, "distance": 0.3 * k, "cluster": side,
                    "coordinate": 0.1 * side, "path": path.ravel(),
                }
            )  # fmt: skip
    return pd.DataFrame(rows)


def neighbourhoods(width, admissible=False, rows=30, steps=10):
    rng = np.random.default_rng(width)
    walk = np.cumsum(rng.normal(0, 0.01, (rows, 3, steps, width)), axis=2)
    return pd.DataFrame(
        {
            "two_mode": [True] * rows,
            "mean_admissible": [admissible] * rows,
            "mean_reason": ["geometric: scene_collision" if admissible is False else ""] * rows,
            "mean_path": [path.ravel() for path in walk[:, 2]],
            "mode_paths": [[one.ravel(), two.ravel()] for one, two, _ in walk],
        }
    )


def support(width, rows=40):
    return pd.DataFrame(
        {
            "phase": ["reach"] * rows, "index": range(rows),
            "analysed": [i % 3 > 0 for i in range(rows)],
            "two_mode": [i % 6 == 1 for i in range(rows)],
            "position": list(np.random.default_rng(1).normal(size=(rows, width))),
        }
    )  # fmt: skip


def strata(**changed):
    row = {
        "variable": "operator", "phase": "reach", "p_adjusted": 0.01, "effect": 0.6,
        "effect_lower": 0.4, "effect_upper": 0.8, "n": 80,
    }  # fmt: skip
    return pd.DataFrame([row | changed])
