"""Support: how far the nearest training windows are, in normalised observations."""

from typing import Any

from sklearn.neighbors import NearestNeighbors

from genpolicy.contract.normalisation import MinMax
from genpolicy.monitors.protocol import Array, Fit, Invocation

NEIGHBOURS = 5
"""The distance to the fifth: one window alone may be an odd one."""


class Support:
    """Mean Euclidean distance to the five nearest training windows.

    Observations are normalised as for the policies, so that a metre and a one-hot phase weigh by
    their range in training.
    """

    def __init__(self, scale: MinMax, tree: Any) -> None:
        self._scale, self._tree = scale, tree

    @classmethod
    def fitted(cls, fit: Fit) -> "Support":
        """All training windows, in a tree."""
        scale = fit.normalisation.observation
        seen = scale.normalise(fit.windows.observations)
        tree = NearestNeighbors(n_neighbors=min(NEIGHBOURS, len(seen)))
        tree.fit(seen.reshape(len(seen), -1))
        return cls(scale, tree)

    def score(self, invocation: Invocation) -> float:
        """Distance in normalised units."""
        seen: Array = self._scale.normalise(invocation.observations)
        distances, _ = self._tree.kneighbors(seen.reshape(1, -1))
        return float(distances.mean())
