"""Disagreement of training seeds: do other trainings of the method draw the same chunks here?"""

from collections.abc import Sequence

import numpy as np

from genpolicy.contract.normalisation import MinMax
from genpolicy.monitors.distances import energy_distance
from genpolicy.monitors.protocol import Fit, Invocation, Unavailable
from genpolicy.policies.policy import NetworkPolicy

ONE_SEED = Unavailable("one seed: no other training of this method is there")


class SeedDisagreement:
    """Mean energy distance from the draws of a policy to those of each other training seed.

    Sets of draws are compared, not their means: two seeds that know both ways round an obstacle
    agree, whichever way each happens to draw.
    """

    def __init__(self, scale: MinMax, others: Sequence[NetworkPolicy]) -> None:
        self._scale, self._others = scale, others

    @classmethod
    def fitted(cls, fit: Fit) -> "SeedDisagreement | Unavailable":
        """Nothing is learned: the others were trained before."""
        if not fit.others:
            return ONE_SEED
        return cls(fit.normalisation.action, fit.others)

    def score(self, invocation: Invocation) -> float:
        """Normalised units."""
        own = self._scale.normalise(invocation.chunks)
        found = []
        for other in self._others:
            drawn = other.sample(
                invocation.observations[None],
                noise_names=[("disagreement",)],
                candidates=len(own) if other.stochastic else 1,
            ).finite()
            found.append(energy_distance(own, self._scale.normalise(drawn.actions[0])))
        return float(np.mean(found))
