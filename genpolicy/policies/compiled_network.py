"""Evaluations of a network that is asked many times for a chunk, by compiled products.

A sampler evaluates the residual network of a diffusion or a flow once a step, on few rows. torch's
matrix library makes little of few rows, and a single one it adds up in another order. Here the
weights lie as the products read them, one after the other, and every row is added up alone, in the
order of the library's larger products; what is no product stays torch's. The order is found out,
and the result tried, with the network that is sampled (`call_shapes`): where a bit differs, on a
machine with another library, torch evaluates as before.
"""

from dataclasses import dataclass
from typing import cast

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional

from genpolicy.policies.ahead import Finish
from genpolicy.policies.kernels.layers import TOGETHER, added, enter, gained, linear, modulated
from genpolicy.policies.networks import PolicyNetwork, Prepared
from genpolicy.policies.trunks import Trunk

Array = NDArray[np.float32]

BLOCK = 192
"""Inputs that the library adds up at a time where it has more than twice as many; where it has
fewer than that it halves them, and up to one block it takes them whole."""


@dataclass(frozen=True)
class Packed:
    """A linear layer as its product reads it.

    Attributes:
        weight: Shape (K, N).
        bias: Shape (N,).
        block: Inputs that are added up at a time.
    """

    weight: Array
    bias: Array
    block: int


def packed(layer: nn.Linear) -> Packed:
    """The weights of a layer, copied."""
    inputs = layer.in_features
    block = inputs if inputs <= BLOCK else min(BLOCK, inputs // 2)
    weight = _room(layer.in_features, layer.out_features)
    weight[:] = layer.weight.detach().numpy().T
    return Packed(weight, layer.bias.detach().clone().numpy(), block)


class CompiledNetwork:
    """The layers of a network whose trunk is residual and whose head reads a chunk and a time."""

    def __init__(self, network: PolicyNetwork) -> None:
        trunk, head = network.trunk, network.head
        assert isinstance(trunk, Trunk) and head.entry is not None
        self.entry, self.direct = packed(head.entry), packed(head.direct)
        self.branch_in, self.branch_out = packed(head.branch_in), packed(head.branch_out)
        self.blocks = [
            (packed(cast(nn.Linear, first)), packed(cast(nn.Linear, second)))
            for first, second in zip(trunk.first, trunk.second, strict=True)
        ]

    def finish(self, rows: int) -> Finish:
        """The rest of an evaluation of so many rows; each that is made has room of its own."""
        return Run(self, rows).finish


class Run:
    """Evaluations of one number of rows, one after the other.

    Tensors and arrays of one name are two views of one room.
    """

    def __init__(self, network: CompiledNetwork, rows: int) -> None:
        sums: dict[int, Array] = {}

        def with_room(layer: Packed) -> tuple[Array, Array, int, Array]:
            outputs = len(layer.bias)
            own = sums.setdefault(outputs, _room(TOGETHER, outputs))
            return layer.weight, layer.bias, layer.block, own

        self._entry, self._direct = with_room(network.entry), with_room(network.direct)
        self._branch_in = with_room(network.branch_in)
        self._branch_out = with_room(network.branch_out)
        self._blocks = [(with_room(one), with_room(other)) for one, other in network.blocks]
        inputs, width = network.entry.weight.shape
        branch, outputs = network.branch_out.weight.shape
        self._hidden_rows, self._hidden = _shared(rows, width)
        self._inner_rows, self._inner = _shared(rows, width)
        self._branch_rows, self._branch = _shared(rows, branch)
        self._entered, self._room = _room(rows, inputs), _room(rows, width)
        self._said, self._added = _room(rows, outputs), _room(rows, outputs)

    def finish(self, prepared: Prepared, values: Tensor) -> Tensor:
        """The rest of an evaluation: as `PolicyNetwork.finish`, of values (B, K, D_a)."""
        gains, hidden, context = prepared.gains, self._hidden, prepared.context.numpy()
        assert gains is not None
        rows, width = hidden.shape
        flat = values.reshape(rows, -1).numpy()
        # What is compiled looks at no bounds.
        assert flat.shape == self._entered.shape
        assert len(context) == len(gains.inner) and len(context) in {1, rows}
        enter(flat, gains.inner.numpy(), self._entered, hidden, *self._entry)
        for index, (first, second) in enumerate(self._blocks):
            normed = torch.layer_norm(self._hidden_rows, (width,)).numpy()
            modulated(normed, context, 2 * index * width, self._room, self._inner, *first)
            functional.silu(self._inner_rows, inplace=True)
            added(self._inner, self._room, hidden, *second)
        linear(functional.silu(self._hidden_rows).numpy(), self._branch, *self._branch_in)
        functional.silu(self._branch_rows, inplace=True)
        linear(hidden, self._said, *self._direct)
        added(self._branch, self._added, self._said, *self._branch_out)
        found = torch.empty(values.shape)
        out = found.numpy().reshape(flat.shape)
        gained(flat, self._said, gains.skip.numpy(), gains.outer.numpy(), out)
        return found


def _shared(rows: int, numbers: int) -> tuple[Tensor, Array]:
    room = torch.empty(rows, numbers)
    return room, room.numpy()


def _room(rows: int, numbers: int) -> Array:
    """Tensors begin where a vector register does, arrays need not."""
    return _shared(rows, numbers)[1]
