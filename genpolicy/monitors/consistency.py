"""Chunk-to-chunk consistency: does an invocation still say what the one before it said?"""

from genpolicy.contract.normalisation import MinMax
from genpolicy.monitors.distances import energy_distance
from genpolicy.monitors.protocol import Fit, Invocation


class ChunkConsistency:
    """Energy distance between the draws of two invocations in a row, where both speak of one time.

    After STAC (Agia et al., arXiv 2410.04640), which takes a kernel distance and adds up over an
    episode; here the distance has no width, and nothing is added up: a score is of its moment.
    """

    def __init__(self, scale: MinMax, action_period_s: float) -> None:
        self._scale, self._period_s = scale, action_period_s

    @classmethod
    def fitted(cls, fit: Fit) -> "ChunkConsistency":
        """Nothing is learned but the scale of actions."""
        return cls(fit.normalisation.action, fit.action_period_s)

    def score(self, invocation: Invocation) -> float:
        """Normalised units; 0 of the first invocation and of chunks that do not overlap."""
        before = invocation.before
        if before is None:
            return 0.0
        rows = invocation.chunks.shape[1]
        passed = round((invocation.time_s - before.time_s) / self._period_s)
        if not 0 < passed < rows:
            return 0.0
        own = self._scale.normalise(invocation.chunks)[:, : rows - passed]
        return energy_distance(self._scale.normalise(before.chunks)[:, passed:], own)
