"""Support: zero on a training window, and growing with the way out."""

import numpy as np
import pytest

from genpolicy.contract.normalisation import MinMax
from genpolicy.monitors.protocol import Fit, Invocation
from genpolicy.monitors.support import Support
from genpolicy.policies.normalisation import Normalisation
from genpolicy.policies.windows import Windows


def test_golden_distance_by_hand():
    """Windows at -1 and 1 of one number; 3 is 2 and 4 away, once for each of two observations."""
    windows = Windows(
        np.array([[[-1.0], [-1.0]], [[1.0], [1.0]]]), np.zeros((2, 1, 1)), np.zeros((2, 1), bool)
    )
    scale = MinMax(np.array([-1.0]), np.array([1.0]))
    monitor = Support.fitted(Fit(windows, Normalisation(scale, scale), 0.05))
    seen = Invocation(0.0, np.array([[3.0], [3.0]]), np.zeros((1, 1, 1)))
    assert monitor.score(seen) == pytest.approx(3 * np.sqrt(2))


def test_further_out_scores_higher(kit):
    monitor = Support.fitted(kit.fit())
    scores = [monitor.score(kit.invocation(shift=shift)) for shift in (0.0, 0.3, 0.6, 1.2)]
    assert scores == sorted(scores)
    assert scores[1] > 2 * scores[0]


def test_a_channel_that_training_never_moved_does_not_weigh(kit):
    """What is constant in training is normalised to nothing: its support is not known."""
    windows = Windows(np.zeros((2, 1, 2)), np.zeros((2, 1, 1)), np.zeros((2, 1), bool))
    windows.observations[1, :, 0] = 1.0
    scale = MinMax(np.zeros(2), np.array([1.0, 0.0]))
    monitor = Support.fitted(Fit(windows, Normalisation(scale, scale), 0.05))
    near, far = (Invocation(0.0, np.array([[1.0, x]]), np.zeros((1, 1, 1))) for x in (0.0, 9.0))
    assert monitor.score(near) == monitor.score(far)
