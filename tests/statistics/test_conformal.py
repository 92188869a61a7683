"""The conformal threshold covers as often as it says."""

import math

import numpy as np

from genpolicy.seeds import stream
from genpolicy.statistics.conformal import conformal_threshold


def test_conformal_rank_rule():
    assert conformal_threshold(np.arange(1.0, 20.0), 0.05) == 19.0
    assert conformal_threshold(np.arange(1.0, 19.0), 0.05) == math.inf
    rng = stream(4, "conformal")
    scores = rng.normal(size=(4000, 51))
    alarms = [s[-1] > conformal_threshold(s[:-1], 0.05) for s in scores]
    assert np.mean(alarms) <= 0.05 + 3 * math.sqrt(0.05 * 0.95 / 4000)
