"""Denoising residual: the training loss of a policy at its own sample."""

import numpy as np
import torch
from torch import Tensor

from genpolicy.monitors.protocol import NO_WEIGHTS, Fit, Invocation, Unavailable
from genpolicy.policies.determinism import deterministic
from genpolicy.policies.methods import method_named
from genpolicy.policies.objectives import Batch, Denoising, FlowMatching, Objective
from genpolicy.policies.policy import NetworkPolicy

DRAWS = 32
"""Noises and noise levels per score."""
SEED = 0


class OwnLoss:
    """Mean training loss over fixed noises and levels, the first candidate in place of the label.

    The same noises every time, so that two scores differ by what was seen and drawn alone.

    Source:
        Lee et al., arXiv 2410.14868 (Diff-DAgger).
    """

    def __init__(self, policy: NetworkPolicy, objective: Objective) -> None:
        self._policy, self._objective = policy, objective

    @classmethod
    def fitted(cls, fit: Fit) -> "OwnLoss | Unavailable":
        """Nothing is learned: the loss is the policy's."""
        if fit.policy is None:
            return NO_WEIGHTS
        config = fit.policy.checkpoint.config
        method = method_named(config.method)
        objective = method.objective(config.dimensions, config.network, config.head)
        if not isinstance(objective, Denoising | FlowMatching):
            return Unavailable(f"{config.method} is trained to denoise nothing")
        return cls(fit.policy, objective)

    def score(self, invocation: Invocation) -> float:
        """Mean squared error per number of the chunk, normalised units."""
        policy = self._policy
        chunk = policy.checkpoint.normalisation.action.normalise(invocation.chunks[0])
        actions = torch.as_tensor(chunk.astype(np.float32)).to(policy.device)
        batch = Batch(
            observations=_repeated(policy.preprocess(invocation.observations[None])[0]),
            actions=_repeated(actions),
            weight=torch.ones((DRAWS, len(chunk), 1), device=policy.device),
        )
        noises = torch.Generator(device=policy.device).manual_seed(SEED)
        with deterministic(policy.device), torch.inference_mode():
            return float(self._objective.loss(policy.checkpoint.network, batch, noises))


def _repeated(row: Tensor) -> Tensor:
    return row.expand(DRAWS, *row.shape).contiguous()
