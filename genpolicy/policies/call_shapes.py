"""How many rows a network call has: as few as are asked for, where that changes no bit of a row.

A matrix product may add up a row in another order when it has other rows beside it: here a product
of one or two rows does, one of four does not. A sample is what calls of `batch_rows` rows make of
it. Fewer or more rows are used only where this network, on this machine, gave the same bits with
them in a trial; nothing else follows from it than time.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from genpolicy.policies.ahead import padded
from genpolicy.policies.checkpoint import CheckpointConfig
from genpolicy.policies.determinism import deterministic
from genpolicy.policies.methods import (
    ENERGY_SAMPLERS,
    SINGLE_EVALUATION,
    announced_times,
    noise_shape,
)
from genpolicy.policies.networks import PolicyNetwork
from genpolicy.policies.settings import SamplerConfig

TRIED = (4, 8, 32)
SPREAD = 32
"""Rows of the trial; in calls of another size each stands at another place."""

# (inputs, a row each) -> what is compared, a row each
Call = Callable[[Sequence[Tensor]], Tensor]

_measured: dict[str, tuple[int, ...]] = {}


@dataclass(frozen=True)
class CallShapes:
    """Numbers of rows of a network call that give a row the same bits, ascending."""

    sizes: tuple[int, ...]

    @property
    def most(self) -> int:
        """The largest of them."""
        return self.sizes[-1]

    def fit(self, count: int) -> int:
        """The smallest one that holds so many rows; the largest where none does."""
        return next((size for size in self.sizes if size >= count), self.most)


def call_shapes(
    network: PolicyNetwork, config: CheckpointConfig, sampler: SamplerConfig, *, device: str
) -> CallShapes:
    """The shapes for a network; measured once in a process for networks of equal sizes.

    The energy's search has products of its own, and other devices choose their kernels by shape:
    both keep `batch_rows`.
    """
    size = sampler.batch_rows
    if device != "cpu" or sampler.name in ENERGY_SAMPLERS:
        return CallShapes((size,))
    reads = sampler.name if sampler.name in SINGLE_EVALUATION else "chunk"
    key = repr((config.method, config.dimensions, config.network, config.head, size, reads))
    if key not in _measured:
        with deterministic(device), torch.inference_mode():
            call, inputs = _whole(network, config, sampler)
            _measured[key] = equal_sizes(call, inputs, size=size)
    return CallShapes(_measured[key])


def equal_sizes(call: Call, inputs: Sequence[Tensor], *, size: int) -> tuple[int, ...]:
    """`size`, and those of `TRIED` by which every row comes out as by `size`; ascending."""
    expected = _in_calls(call, inputs, size)
    equal = [tried for tried in TRIED if torch.equal(_in_calls(call, inputs, tried), expected)]
    return tuple(sorted({size, *equal}))


def _in_calls(call: Call, inputs: Sequence[Tensor], size: int) -> Tensor:
    """The result of every row, by calls of `size` rows."""
    found = []
    for first in range(0, len(inputs[0]), size):
        rows = [values[first : first + size] for values in inputs]
        found.append(call([padded(values, size) for values in rows])[: len(rows[0])])
    return torch.cat(found)


def _whole(
    network: PolicyNetwork, config: CheckpointConfig, sampler: SamplerConfig
) -> tuple[Call, list[Tensor]]:
    """Encoder and one evaluation of a network, and rows to try it with."""
    generator, sizes = torch.Generator().manual_seed(0), config.dimensions
    observed = (SPREAD, sizes.observation_horizon, sizes.observation_dim)
    shape = noise_shape(sizes, sampler, config.head)
    times = announced_times(sampler, config.head) or [0.5]
    inputs = [
        torch.randn(observed, generator=generator),
        torch.randn((SPREAD, *shape), generator=generator),
        torch.tensor([times[row % len(times)] for row in range(SPREAD)]),
    ]

    def call(rows: Sequence[Tensor]) -> Tensor:
        observations, values, time = rows
        condition = network.encode(observations)
        if sampler.name == "direct":
            found = network.evaluate(condition)
        elif sampler.name in SINGLE_EVALUATION:
            found = network.evaluate(condition, values)
        else:
            found = network.evaluate(condition, values, time)
        return torch.cat([condition, found.flatten(1)], dim=1)

    return call, inputs
