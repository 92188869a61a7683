"""Least smoothing of a joint path that keeps it within rate limits.

A generated chunk carries jitter of a millimetre or so, which at the action period is a large
acceleration. The path is smoothed by penalised least squares with the commands before it as its
fixed beginning; of a fixed ladder of penalties the smallest is taken that keeps to the limits.
A path within the limits is left alone, and so is one that no penalty brings within them.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

PENALTIES = tuple(float(p) for p in np.geomspace(0.03, 3000.0, 18))
ORDER = 2  # differences of second order are penalised: accelerations
TIGHTENED = 0.97  # a smoothed path keeps this part of its limits, so that it is left alone later


@lru_cache(maxsize=64)
def ladder(points: int, fixed_points: int) -> tuple[Array, Array]:
    """Per penalty, matrices on the path (L, n, n) and on the fixed points before it (L, n, s)."""
    total = points + fixed_points
    differences = np.diff(np.eye(total), n=ORDER, axis=0) if total > ORDER else np.zeros((0, total))
    fixed, free = differences[:, :fixed_points], differences[:, fixed_points:]
    on_path, on_fixed = [], []
    for penalty in PENALTIES:
        inverse = np.linalg.inv(np.eye(points) + penalty * free.T @ free)
        on_path.append(inverse)
        on_fixed.append(-penalty * inverse @ free.T @ fixed)
    return np.stack(on_path), np.stack(on_fixed)
