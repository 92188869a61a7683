"""Encoder distance: the mean of the training windows is its number of features."""

import numpy as np

from genpolicy.monitors.encoder import EncoderDistance
from genpolicy.monitors.protocol import NO_WEIGHTS, Invocation


def test_training_windows_lie_no_farther_than_there_are_features(kit):
    """The mean squared Mahalanobis distance of a sample to its own mean is its dimension; a shrunk
    covariance is wider in the small directions, so that less is left.
    """
    fit = kit.fit("flow")
    monitor = EncoderDistance.fitted(fit)
    scores = [
        monitor.score(Invocation(0.0, seen, np.zeros((1, 4, 2))))
        for seen in fit.windows.observations[:100]
    ]
    assert 1 < np.mean(scores) <= 16


def test_further_out_scores_higher(kit):
    monitor = EncoderDistance.fitted(kit.fit("flow"))
    scores = [monitor.score(kit.invocation(shift=shift)) for shift in (0.0, 0.5, 1.0)]
    assert scores == sorted(scores)


def test_without_weights_there_is_none(kit):
    assert EncoderDistance.fitted(kit.fit()) is NO_WEIGHTS
