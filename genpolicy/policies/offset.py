"""The cheapest remedy of an averaged plan: a trained chunk, moved by a draw that nothing learned.

A policy of regression predicts one chunk; where demonstrations differ, that chunk may lie where
nobody went. Here the chunk is moved by

    offset[k, d] = rms[phase, k, d] * z[d],    z ~ N(0, I)

with `rms` the root mean square error of the trained policy on its own training windows, per
phase, row of the chunk and component of the action. One draw per component and chunk: an offset
keeps its side from the first row to the last, as a plan does, and grows as the demonstrations
part. Nothing is learned for it, and no held-out episode and no start is looked at.
"""

import torch
from torch import Tensor

from genpolicy.errors import ContractError
from genpolicy.policies.networks import Dimensions, HeadInput, PolicyNetwork
from genpolicy.policies.objectives import Batch, SquaredError
from genpolicy.policies.settings import HeadConfig, NetworkConfig

ROWS_PER_PASS = 4096


class OffsetNetwork(PolicyNetwork):
    """The network of a policy of regression, and the scale of its offset by phase.

    The condition ends with the phase, one number for each that the observation names; a task
    whose observation names none has one scale.
    """

    scale: Tensor

    def __init__(self, dimensions: Dimensions, config: NetworkConfig) -> None:
        super().__init__(dimensions, config, head_input=HeadInput(numbers=0, gains=None))
        self._columns = list(dimensions.phase_columns)
        shape = (
            max(1, len(self._columns)),
            dimensions.prediction_horizon,
            dimensions.action_dim,
        )
        self.register_buffer("scale", torch.zeros(shape))

    def encode(self, observations: Tensor) -> Tensor:
        """Conditions (B, C + phases) of normalised observations (B, H_o, D_o)."""
        return torch.cat([super().encode(observations), self.phases(observations)], dim=-1)

    def phases(self, observations: Tensor) -> Tensor:
        """The phase of the newest observation, one-hot. Shape (B, phases)."""
        if not self._columns:
            return observations.new_ones((len(observations), 1))
        newest = observations[:, -1, self._columns]
        named = torch.zeros_like(newest)
        return named.scatter_(1, newest.argmax(dim=1, keepdim=True), 1.0)

    def evaluate(
        self, condition: Tensor, values: Tensor | None = None, time: Tensor | None = None
    ) -> Tensor:
        """Chunks (B, K, D_a) of conditions, moved by draws (B, D_a); by nothing where None."""
        count = len(self.scale)
        chunks = super().evaluate(condition[:, :-count])
        if values is None:
            return chunks
        scale = torch.einsum("bp,pkd->bkd", condition[:, -count:], self.scale)
        return chunks + scale * values[:, None, :]

    def fit(self, data: Batch) -> None:
        """Take the scale from the training windows; a phase without one is left at zero."""
        squares = torch.zeros(self.scale.shape, dtype=torch.float64)
        counts = torch.zeros((*self.scale.shape[:2], 1), dtype=torch.float64)
        for first in range(0, len(data.actions), ROWS_PER_PASS):
            rows = slice(first, first + ROWS_PER_PASS)
            seen, weight = data.observations[rows], data.weight[rows].cpu().double()
            predicted = self.evaluate(self.encode(seen))
            error = (data.actions[rows] - predicted).cpu().double().square() * weight
            phases = self.phases(seen).cpu().double()
            squares += torch.einsum("bp,bkd->pkd", phases, error)
            counts += torch.einsum("bp,bkd->pkd", phases, weight)
        rms = (squares / counts.clamp(min=1.0)).sqrt()
        self.scale.copy_(rms.to(torch.float32))


class OffsetError(SquaredError):
    """Squared error of the chunk; the scale of the offset is taken from what is left of it."""

    def __init__(self, dimensions: Dimensions, network: NetworkConfig, head: HeadConfig) -> None:
        super().__init__()

    def finish(self, network: PolicyNetwork, data: Batch) -> None:
        """Fix the scale by the training split, after the last update.

        Raises:
            ContractError: A network without a scale.
        """
        if not isinstance(network, OffsetNetwork):
            raise ContractError(
                where="the scale of an offset",
                found=type(network).__name__,
                expected="a network that has one",
                action="Train the method under its registered name.",
            )
        with torch.no_grad():
            network.fit(data)
