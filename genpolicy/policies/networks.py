"""One encoder class and one head class with three kinds of input, around a trunk (`trunks`).

Every method has the same encoder and the same trunk, number for number. Heads differ in what
they feed the trunk (nothing, a latent, a noisy chunk with a time); the hidden width of each
readout is solved from one parameter budget, so that no method is simply larger.
"""

import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated

import torch
from pydantic import Field
from torch import Tensor, nn
from torch.nn import functional

from genpolicy.contract.settings import Settings
from genpolicy.errors import ConfigError
from genpolicy.policies.schedules import Gains
from genpolicy.policies.settings import WIDTH_UNIT, NetworkConfig
from genpolicy.policies.trunks import TokenLinear, make_trunk

FASTEST_TIME_FREQUENCY = 200.0


class Dimensions(Settings):
    """Sizes that data and horizons fix.

    Attributes:
        observation_horizon: H_o.
        observation_dim: D_o.
        prediction_horizon: K.
        action_dim: D_a.
        phase_columns: Numbers of an observation that name the phase, one-hot; none where the
            observation does not name it.
    """

    observation_horizon: int = Field(ge=1, le=64)
    observation_dim: int = Field(ge=1, le=4096)
    prediction_horizon: int = Field(ge=1, le=512)
    action_dim: int = Field(ge=1, le=512)
    phase_columns: tuple[Annotated[int, Field(ge=0, lt=4096)], ...] = ()

    @property
    def chunk_numbers(self) -> int:
        """Numbers of one chunk, K times D_a."""
        return self.prediction_horizon * self.action_dim


@dataclass(frozen=True)
class HeadInput:
    """What a head feeds the trunk besides the condition.

    Attributes:
        numbers: Length of the input vector; 0 for a head without one.
        gains: Fixed gains of a sampler time, for a noisy chunk; None for a head without a time.
    """

    numbers: int
    gains: Callable[[Tensor], Gains] | None


@dataclass(frozen=True)
class Prepared:
    """What a network evaluation needs besides its values.

    Attributes:
        context: What the trunk makes of condition and time. Shape (B, ...).
        gains: Gains at the time; None for a head without one. Shapes (B,).
    """

    context: Tensor
    gains: Gains | None

    def rows(self, choose: Callable[[Tensor], Tensor]) -> "Prepared":
        """The same of rows that `choose` takes from a tensor (B, ...)."""
        gains = self.gains
        if gains is not None:
            gains = Gains(choose(gains.inner), choose(gains.skip), choose(gains.outer))
        return Prepared(choose(self.context), gains)


def joined(parts: Sequence[Prepared]) -> Prepared:
    """The rows of all parts, one part after the other; at least one part."""
    contexts = torch.cat([part.context for part in parts])
    gains = [part.gains for part in parts if part.gains is not None]
    if not gains:
        return Prepared(contexts, None)
    return Prepared(
        contexts,
        Gains(
            torch.cat([own.inner for own in gains]),
            torch.cat([own.skip for own in gains]),
            torch.cat([own.outer for own in gains]),
        ),
    )


def apart(prepared: Prepared, count: int) -> list[Prepared]:
    """Parts of `count` rows, one after the other; of none left over."""
    contexts, gains = torch.split(prepared.context, count), prepared.gains
    if gains is None:
        return [Prepared(context, None) for context in contexts]
    own = (torch.split(part, count) for part in (gains.inner, gains.skip, gains.outer))
    return [
        Prepared(context, Gains(*parts)) for context, *parts in zip(contexts, *own, strict=True)
    ]


class Encoder(nn.Module):
    """Condition vector of the last H_o observations."""

    def __init__(self, dimensions: Dimensions, config: NetworkConfig) -> None:
        super().__init__()
        numbers = dimensions.observation_horizon * dimensions.observation_dim
        self.hidden = None
        if config.encoder == "mlp":
            self.hidden = nn.Linear(numbers, config.encoder_width)
            numbers = config.encoder_width
        self.out = nn.Linear(numbers, config.condition_dim)

    def forward(self, observations: Tensor) -> Tensor:
        """Normalised observations (B, H_o, D_o) to conditions (B, C)."""
        numbers = observations.flatten(1)
        if self.hidden is not None:
            numbers = functional.silu(self.hidden(numbers))
        condition: Tensor = self.out(numbers)
        return condition


class Head(nn.Module):
    """Input projection, time embedding and readout; fills the parameter budget."""

    def __init__(
        self, dimensions: Dimensions, config: NetworkConfig, *, head_input: HeadInput
    ) -> None:
        super().__init__()
        width, outputs = config.trunk_width, dimensions.chunk_numbers
        if head_input.numbers:
            self.entry: nn.Linear | None = nn.Linear(head_input.numbers, width)
        else:
            self.entry = None
            self.start = nn.Parameter(torch.zeros(width))
        self.time_features = config.time_features
        self.time: nn.Sequential | None = None
        if head_input.gains is not None:
            self.time = nn.Sequential(
                nn.Linear(config.time_features, config.condition_dim),
                nn.SiLU(),
                nn.Linear(config.condition_dim, config.condition_dim),
            )
        self.direct = nn.Linear(width, outputs)
        spent = sum(parameter.numel() for parameter in self.parameters())
        cost = WIDTH_UNIT * (width + outputs + 1)
        hidden = WIDTH_UNIT * round((config.head_parameters - spent - outputs) / cost)
        if not hidden >= WIDTH_UNIT:
            raise ConfigError(
                where="network.head_parameters",
                found=str(config.head_parameters),
                expected=f"at least {spent + outputs + cost} for this head",
                action="Raise the budget of the head, for every method alike.",
            )
        self.branch_in = nn.Linear(width, hidden)
        self.branch_out = nn.Linear(hidden, outputs)

    def enter(self, values: Tensor | None, rows: int) -> Tensor:
        """Trunk input (B, W) of a latent or a flattened chunk, or of nothing."""
        if self.entry is None or values is None:
            return self.start.expand(rows, -1)
        entered: Tensor = self.entry(values.flatten(1))
        return entered

    def embed_time(self, time: Tensor) -> Tensor:
        """Embedding (B, C) of sampler times (B,), added to the condition."""
        assert self.time is not None
        angles = time[:, None] * _frequencies(self.time_features).to(time)
        embedding: Tensor = self.time(torch.cat([angles.sin(), angles.cos()], dim=-1))
        return embedding

    def read_out(self, features: Tensor) -> Tensor:
        """Features (B, W) to numbers (B, K * D_a): a linear path and a one-hidden-layer path."""
        branch = self.branch_out(functional.silu(self.branch_in(functional.silu(features))))
        numbers: Tensor = self.direct(features) + branch
        return numbers


class PolicyNetwork(nn.Module):
    """Encoder, trunk and head of one method; all that inference needs."""

    def __init__(
        self, dimensions: Dimensions, config: NetworkConfig, *, head_input: HeadInput
    ) -> None:
        super().__init__()
        self.dimensions = dimensions
        self._gains = head_input.gains
        self.encoder = Encoder(dimensions, config)
        self.trunk = make_trunk(config)
        self.head = self.make_head(dimensions, config, head_input)

    def make_head(
        self, dimensions: Dimensions, config: NetworkConfig, head_input: HeadInput
    ) -> Head:
        """The head; made last, so that equal seeds give every method one encoder and trunk."""
        return Head(dimensions, config, head_input=head_input)

    def encode(self, observations: Tensor) -> Tensor:
        """Normalised observations (B, H_o, D_o) to conditions (B, C)."""
        condition: Tensor = self.encoder(observations)
        return condition

    def evaluate(
        self, condition: Tensor, values: Tensor | None = None, time: Tensor | None = None
    ) -> Tensor:
        """One network evaluation.

        Args:
            condition: From `encode`. Shape (B, C).
            values: Latent (B, Z) or noisy chunk (B, K, D_a); None for a head without input.
            time: Sampler time (B,); None for a head without one.

        Returns:
            Shape (B, K, D_a).
        """
        return self.finish(self.prepare(condition, time), values)

    def prepare(self, condition: Tensor, time: Tensor | None = None) -> Prepared:
        """What an evaluation needs of conditions (B, C) and times (B,), whatever its values are."""
        if time is None or self._gains is None:
            return Prepared(self.trunk.prepare(condition), None)
        context = self.trunk.prepare(condition + self.head.embed_time(time))
        return Prepared(context, self._gains(time))

    def finish(self, prepared: Prepared, values: Tensor | None) -> Tensor:
        """The rest of an evaluation: chunks (B, K, D_a) of values, as of `evaluate`.

        Args:
            prepared: A row for each of the values, or one for all of them.
            values: Latent (B, Z) or noisy chunk (B, K, D_a); None for a head without input.
        """
        gains = prepared.gains
        if gains is None or values is None:
            return self._chunk(prepared.context, values)
        residual = self._chunk(prepared.context, gains.inner[:, None, None] * values)
        return gains.skip[:, None, None] * values + gains.outer[:, None, None] * residual

    def _chunk(self, context: Tensor, values: Tensor | None) -> Tensor:
        features = self.trunk(self.head.enter(values, len(context)), context)
        return self.head.read_out(features).reshape(
            -1, self.dimensions.prediction_horizon, self.dimensions.action_dim
        )


def parameter_counts(network: PolicyNetwork) -> dict[str, int]:
    """Parameters of encoder, trunk, head, and their total."""
    counts = {
        name: sum(parameter.numel() for parameter in part.parameters())
        for name, part in _parts(network).items()
    }
    return {**counts, "total": sum(counts.values())}


def flops_per_evaluation(network: PolicyNetwork) -> dict[str, int]:
    """Multiplications and additions of the matrix products for one row, per part.

    The encoder runs once per invocation, trunk and head once per network evaluation.
    """
    counts = {
        name: sum(
            2 * layer.in_features * layer.out_features * _tokens(layer)
            for layer in part.modules()
            if isinstance(layer, nn.Linear)
        )
        for name, part in _parts(network).items()
    }
    return {**counts, "total": sum(counts.values())}


def _tokens(layer: nn.Linear) -> int:
    return layer.tokens if isinstance(layer, TokenLinear) else 1


@functools.lru_cache(maxsize=16)
def _frequencies(time_features: int) -> Tensor:
    """Angular frequencies, geometric from pi to 200 pi. Shape (time_features / 2,)."""
    half = time_features // 2
    exponents = torch.arange(half, dtype=torch.float32) / max(1, half - 1)
    return math.pi * FASTEST_TIME_FREQUENCY**exponents


def _parts(network: PolicyNetwork) -> dict[str, nn.Module]:
    return {"encoder": network.encoder, "trunk": network.trunk, "head": network.head}
