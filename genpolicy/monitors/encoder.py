"""Encoder distance: how far the policy's own features are from those of its training windows."""

from typing import Any

import numpy as np
from sklearn.covariance import LedoitWolf

from genpolicy.monitors.protocol import NO_WEIGHTS, Array, Fit, Invocation, Unavailable
from genpolicy.policies.policy import NetworkPolicy


class EncoderDistance:
    """Squared Mahalanobis distance in the encoder's features, with a shrunk covariance.

    Source:
        Lee et al., arXiv 1807.03888, with one class; Ledoit and Wolf 2004 for the covariance.
    """

    def __init__(self, policy: NetworkPolicy, covariance: Any) -> None:
        self._policy, self._covariance = policy, covariance

    @classmethod
    def fitted(cls, fit: Fit) -> "EncoderDistance | Unavailable":
        """Mean and covariance of the features of all training windows."""
        if fit.policy is None:
            return NO_WEIGHTS
        features = _features(fit.policy, fit.windows.observations)
        return cls(fit.policy, LedoitWolf().fit(features))

    def score(self, invocation: Invocation) -> float:
        """Squared distance, in variances of the training windows."""
        features = _features(self._policy, invocation.observations[None])
        return float(self._covariance.mahalanobis(features)[0])


def _features(policy: NetworkPolicy, observations: Array) -> Array:
    features: Array = policy.encode(policy.preprocess(observations)).cpu().numpy()
    return features.astype(np.float64)
