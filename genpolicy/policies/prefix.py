"""Given actions that a chunk is drawn to go on from, as who asks for it says them.

Apart from `genpolicy.policies.guidance` and `genpolicy.policies.warm_start`, which do it: who asks
over a wire, and who judges what was asked, needs no torch.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Prefix:
    """What each row of a batch is drawn to go on from.

    Attributes:
        actions: Given actions, physical units; of no consequence where the weight is 0.
            Shape (B, K, D_a).
        weights: From 0, free, to 1, as given. Shape (B, K).
        bound: Largest factor of the guidance, > 0.
        strength: Share of the sampler's steps that are taken, in (0, 1], where the given actions
            are what sampling starts from; None where they guide it. A row with no weight at all
            starts from noise alone.
    """

    actions: Array
    weights: Array
    bound: float
    strength: float | None = None

    def of(self, rows: Sequence[int]) -> "Prefix":
        """The same of some rows of the batch, in this order."""
        chosen = list(rows)
        return replace(self, actions=self.actions[chosen], weights=self.weights[chosen])
