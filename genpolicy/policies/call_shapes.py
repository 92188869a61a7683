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

from genpolicy.policies.ahead import Finish, padded
from genpolicy.policies.checkpoint import CheckpointConfig
from genpolicy.policies.determinism import deterministic
from genpolicy.policies.methods import (
    ENERGY_SAMPLERS,
    SINGLE_EVALUATION,
    announced_times,
    noise_shape,
)
from genpolicy.policies.networks import PolicyNetwork, Prepared
from genpolicy.policies.schedules import Gains
from genpolicy.policies.settings import SamplerConfig
from genpolicy.policies.trunks import Trunk

TRIED = (4, 8, 32)
TRIED_COMPILED = (1, 2, 8, 16, 24, 32)
"""Eight rows share a reading of the weights, and three or more cost what eight do."""
SPREAD = 32
"""Rows of the trial; in calls of another size each stands at another place."""

# (inputs, a row each) -> what is compared, a row each
Call = Callable[[Sequence[Tensor]], Tensor]

_measured: dict[str, tuple[int, ...]] = {}
_measured_compiled: dict[str, tuple[int, ...]] = {}


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


@dataclass(frozen=True)
class CompiledCalls:
    """Evaluations of a network by compiled products.

    Attributes:
        shapes: Numbers of rows of an evaluation with the bits of `batch_rows`.
        finish: For so many rows, the rest of an evaluation; each with room of its own.
    """

    shapes: CallShapes
    finish: Callable[[int], Finish]


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
    key = _key(config, size, reads)
    if key not in _measured:
        with deterministic(device), torch.inference_mode():
            call, inputs = _whole(network, config, sampler)
            _measured[key] = equal_sizes(call, inputs, size=size)
    return CallShapes(_measured[key])


def compiled_calls(
    network: PolicyNetwork, config: CheckpointConfig, sampler: SamplerConfig, *, most: int,
    device: str,
) -> CompiledCalls | None:  # fmt: skip
    """A network's evaluations by compiled products, of at most so many rows.

    None where they are not for this network, or not with its bits on this machine. They are for
    what is evaluated many times at announced times on a CPU; one evaluation is not worth it.
    """
    plain = type(network) is PolicyNetwork and isinstance(network.trunk, Trunk)
    if device != "cpu" or not plain or not announced_times(sampler, config.head):
        return None
    # Compiled code takes half a second to come: only where it is used.
    from genpolicy.policies.compiled_network import CompiledNetwork  # noqa: PLC0415

    compiled = CompiledNetwork(network)
    key = _key(config, sampler.batch_rows, "compiled")
    if key not in _measured_compiled:
        with deterministic(device), torch.inference_mode():
            inputs = _prepared(network, config, sampler)
            expected = _in_calls(_finished(lambda _: network.finish), inputs, sampler.batch_rows)
            found = _equal(_finished(compiled.finish), inputs, TRIED_COMPILED, expected)
            _measured_compiled[key] = tuple(found)
    sizes = tuple(size for size in _measured_compiled[key] if size <= most)
    return CompiledCalls(CallShapes(sizes), compiled.finish) if sizes else None


def equal_sizes(call: Call, inputs: Sequence[Tensor], *, size: int) -> tuple[int, ...]:
    """`size`, and those of `TRIED` by which every row comes out as by `size`; ascending."""
    equal = _equal(call, inputs, TRIED, _in_calls(call, inputs, size))
    return tuple(sorted({size, *equal}))


def _equal(
    call: Call, inputs: Sequence[Tensor], sizes: Sequence[int], expected: Tensor
) -> list[int]:
    """Those sizes by which every row comes out as expected."""
    return [size for size in sizes if torch.equal(_in_calls(call, inputs, size), expected)]


def _key(config: CheckpointConfig, size: int, reads: str) -> str:
    """What the bits of a call hang on besides its rows."""
    return repr((config.method, config.dimensions, config.network, config.head, size, reads))


def _in_calls(call: Call, inputs: Sequence[Tensor], size: int) -> Tensor:
    """The result of every row, by calls of `size` rows."""
    found = []
    for first in range(0, len(inputs[0]), size):
        rows = [values[first : first + size] for values in inputs]
        found.append(call([padded(values, size) for values in rows])[: len(rows[0])])
    return torch.cat(found)


def _inputs(config: CheckpointConfig, sampler: SamplerConfig) -> list[Tensor]:
    """Observations, values and times of rows to try a network with."""
    generator, sizes = torch.Generator().manual_seed(0), config.dimensions
    observed = (SPREAD, sizes.observation_horizon, sizes.observation_dim)
    shape = noise_shape(sizes, sampler, config.head)
    # All times of the training, whichever the sampler asks for: at some the gain of what the
    # network says is next to nothing, and would hide its bits.
    levels = torch.arange(SPREAD) * config.head.diffusion_levels // SPREAD
    return [
        torch.randn(observed, generator=generator),
        torch.randn((SPREAD, *shape), generator=generator),
        levels / config.head.diffusion_levels,
    ]


def _whole(
    network: PolicyNetwork, config: CheckpointConfig, sampler: SamplerConfig
) -> tuple[Call, list[Tensor]]:
    """Encoder and one evaluation of a network, and rows to try it with."""

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

    return call, _inputs(config, sampler)


def _prepared(
    network: PolicyNetwork, config: CheckpointConfig, sampler: SamplerConfig
) -> list[Tensor]:
    """What rows to try a network with are prepared to, and their values."""
    observations, values, time = _inputs(config, sampler)
    prepared = network.prepare(network.encode(observations), time)
    gains = prepared.gains
    assert gains is not None
    return [prepared.context, gains.inner, gains.skip, gains.outer, values]


def _finished(finish: Callable[[int], Finish]) -> Call:
    """The rest of an evaluation, of rows that were prepared."""

    def call(rows: Sequence[Tensor]) -> Tensor:
        context, inner, skip, outer, values = rows
        own = finish(len(values))
        gained = own(Prepared(context, Gains(inner, skip, outer)), values)
        alone = own(Prepared(context, Gains(inner, 0.0 * skip, torch.ones_like(outer))), values)
        return torch.cat([gained, alone], dim=1).flatten(1)

    return call
