"""Drawing a chunk that goes on from given actions: the network's prediction, guided by a gradient.

Pseudo-inverse guidance (Song et al., ICLR 2023) as Black et al. use it for flows (arXiv
2506.07339). A point x = a clean + s noise; the clean estimate is pulled by
s min(bound, (a^2 + s^2) / (a s)) J^T [w (given - clean)], J its derivative by x. Written for any a
and s the same holds for a diffusion, where it was made; the prediction of either is moved by what
moves its clean estimate so. Each guided evaluation takes one backward pass through the network,
which costs as much as an evaluation (weights take no gradient) and is counted as one.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from genpolicy.policies.diffusion_samplers import DIFFUSION_SAMPLERS
from genpolicy.policies.ode_samplers import FIXED_TABLEAUS
from genpolicy.policies.predictions import PREDICTIONS
from genpolicy.policies.prefix import Prefix
from genpolicy.policies.samplers import CountedNetwork, NetworkFunction, refuse_name
from genpolicy.policies.schedules import squared_cosine
from genpolicy.policies.settings import HeadConfig, SamplerConfig

Array = NDArray[np.float64]

GUIDED = (*DIFFUSION_SAMPLERS, *FIXED_TABLEAUS)
"""Samplers whose every evaluation has a clean estimate. An adaptive solver would choose its steps
by the guided error, and its cap is one of plain evaluations; a jump has no clean estimate."""


@dataclass(frozen=True)
class Guidance:
    """What the rows of one call of the network go on from, on its device.

    Attributes:
        given: Normalised actions. Shape (B, K, D_a).
        weights: Shape (B, K, 1).
        bound: As in `Prefix`.
    """

    given: Tensor
    weights: Tensor
    bound: float


def guidance_of(
    prefix: Prefix, rows: Sequence[int], normalise: Callable[[Array], Array], *, device: str
) -> Guidance:
    """The guidance of some rows of a batch, in this order."""
    rows = list(rows)
    given = normalise(prefix.actions[rows]).astype(np.float32)
    weights = prefix.weights[rows, :, None].astype(np.float32)
    return Guidance(
        torch.from_numpy(given).to(device), torch.from_numpy(weights).to(device), prefix.bound
    )


@dataclass(frozen=True)
class Path:
    """Between noise and action.

    Attributes:
        shares: a and s at sampler times (B,), each of shape (B, 1, 1).
        clean: Clean estimate of x, the prediction, a and s.
        along: By what the prediction moves where the clean estimate moves by s, from a and s.
    """

    shares: Callable[[Tensor], tuple[Tensor, Tensor]]
    clean: Callable[[Tensor, Tensor, Tensor, Tensor], Tensor]
    along: Callable[[Tensor, Tensor], Tensor]


def path_of(sampler: SamplerConfig, head: HeadConfig) -> Path:
    """The path of a sampler.

    Raises:
        ConfigError: It has none that can be guided.
    """
    if sampler.name in FIXED_TABLEAUS:
        return Path(
            _flow_shares, lambda x, said, _, s: x + s * said, lambda a, _: torch.ones_like(a)
        )
    if sampler.name not in DIFFUSION_SAMPLERS:
        refuse_name(sampler.name, GUIDED)
    schedule, kind = squared_cosine(head.diffusion_levels), PREDICTIONS[head.prediction]

    def shares(time: Tensor) -> tuple[Tensor, Tensor]:
        kept = schedule.kept(time)[:, None, None]
        return kept.sqrt(), (1.0 - kept).sqrt()

    return Path(shares, lambda x, said, a, _: kind.clean(x, said, a**2), MOVED_BY[head.prediction])


MOVED_BY: dict[str, Callable[[Tensor, Tensor], Tensor]] = {
    "noise": lambda a, _: -a,
    "v": lambda a, _: -torch.ones_like(a),
    "x0": lambda _, s: s,
}
"""By prediction of a diffusion: the inverse of its clean estimate, times s."""


class GuidedNetwork:
    """A network function whose clean estimates are pulled to given actions.

    Args:
        network: Counts its evaluations, and the backward passes.
        path: Between noise and action.
        guidance: Where to.
    """

    def __init__(self, network: CountedNetwork, path: Path, guidance: Guidance) -> None:
        self._network, self._path, self._guidance = network, path, guidance

    def __call__(self, chunks: Tensor, time: Tensor) -> Tensor:
        """The guided prediction; a row without a weight has the plain one, bit for bit.

        Raises:
            EvaluationCapError: The network's cap was reached.
        """
        guidance = self._guidance
        with torch.enable_grad():
            point = chunks.detach().requires_grad_(True)
            said = self._network(point, time)
            a, s = self._path.shares(time)
            clean = self._path.clean(point, said, a, s)
        error = guidance.weights * (guidance.given - clean.detach())
        self._network.spend()
        (pull,) = torch.autograd.grad(clean, point, grad_outputs=error)
        factor = ((a**2 + s**2) / (a * s)).clamp(max=guidance.bound)  # infinite at either end
        plain = said.detach()
        moved = plain + self._path.along(a, s) * factor * pull
        return torch.where(guidance.weights.amax(dim=1, keepdim=True) > 0.0, moved, plain)


def guided(
    network: CountedNetwork, sampler: SamplerConfig, head: HeadConfig, guidance: Guidance | None
) -> NetworkFunction:
    """The network as a sampler is to see it: guided, or as it is where nothing is given.

    Raises:
        ConfigError: Guidance of a sampler that has no path to guide.
    """
    return network if guidance is None else GuidedNetwork(network, path_of(sampler, head), guidance)


def _flow_shares(time: Tensor) -> tuple[Tensor, Tensor]:
    a = time[:, None, None]
    return a, 1.0 - a
