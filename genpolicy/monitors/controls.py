"""What every monitor is held against: the time that has passed, and the spread of the draws.

Neither is thought to say whether an observation is out of distribution. A monitor that does no
better than the clock has learned that failures are long.
"""

import numpy as np

from genpolicy.contract.normalisation import MinMax
from genpolicy.monitors.protocol import Fit, Invocation, Unavailable

ONE_CANDIDATE = Unavailable("an invocation draws one candidate, which has no spread")


class TimeInEpisode:
    """The clock."""

    @classmethod
    def fitted(cls, fit: Fit) -> "TimeInEpisode":
        """Nothing is learned."""
        return cls()

    def score(self, invocation: Invocation) -> float:
        """Time from the start of the episode, s."""
        return invocation.time_s


class SampleVariance:
    """Variance of the candidates of one invocation."""

    def __init__(self, scale: MinMax) -> None:
        self._scale = scale

    @classmethod
    def fitted(cls, fit: Fit) -> "SampleVariance | Unavailable":
        """Nothing is learned but the scale of actions."""
        if fit.candidates < 2:
            return ONE_CANDIDATE
        return cls(fit.normalisation.action)

    def score(self, invocation: Invocation) -> float:
        """Mean variance per number of a chunk, normalised units."""
        return float(np.var(self._scale.normalise(invocation.chunks), axis=0).mean())
