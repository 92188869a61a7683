"""A policy whose sampler may give up: an invocation that ends at its cap has no chunk, and counts.

An adaptive solver that reaches `nfe_cap` has nothing to deliver. Where many observations are asked
at once, one hard one must not cost the others their answers: it alone is answered by NaN, which the
first layer of feasibility refuses.
"""

from collections.abc import Sequence

import numpy as np
from torch import Tensor

from genpolicy.contract.action import ACTION_DIM
from genpolicy.errors import EvaluationCapError
from genpolicy.policies.evaluations import allowed_evaluations
from genpolicy.policies.policy import NetworkPolicy
from genpolicy.policies.prefix import Prefix
from genpolicy.policies.protocol import NoiseName, Samples


class AnsweringPolicy(NetworkPolicy):
    """A trained policy that goes on where a sample reaches its sampler's cap.

    Args:
        policy: Whose weights, sampler and device.

    Attributes:
        given_up: Observations so far that were answered by NaN.
    """

    def __init__(self, policy: NetworkPolicy) -> None:
        # What is loaded is shared: its calls were measured and compiled once, and are not again.
        vars(self).update(vars(policy))
        self.given_up = 0

    def sample_encoded(
        self,
        condition: Tensor,
        *,
        noise_names: Sequence[NoiseName],
        candidates: int,
        prefix: Prefix | None = None,
    ) -> Samples:
        """As `NetworkPolicy.sample_encoded`; NaN (N, K, D_a) where a candidate was given up.

        The candidates of one observation are one invocation: it is answered, or it is not.
        """
        try:
            return super().sample_encoded(
                condition, noise_names=noise_names, candidates=candidates, prefix=prefix
            )
        except EvaluationCapError:
            if len(noise_names) == 1:
                return self._nothing(candidates)
        # A sample does not depend on its company: alone, the others are what they would have been.
        parts = [
            self.sample_encoded(
                condition[row : row + 1],
                noise_names=noise_names[row : row + 1],
                candidates=candidates,
                prefix=prefix and prefix.of([row]),
            )
            for row in range(len(noise_names))
        ]
        return Samples(
            np.concatenate([part.actions for part in parts]), max(part.nfe for part in parts)
        )

    def _nothing(self, candidates: int) -> Samples:
        self.given_up += 1
        shape = (1, candidates, self.prediction_horizon, ACTION_DIM)
        return Samples(np.full(shape, np.nan), allowed_evaluations(self.sampler).most)
