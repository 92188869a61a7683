"""Given actions that a chunk is drawn to go on from, as who asks for it says them.

Apart from `genpolicy.policies.guidance`, which does it: who asks over a wire, and who judges what
was asked, needs no torch.
"""

from dataclasses import dataclass

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
    """

    actions: Array
    weights: Array
    bound: float
