"""Trunks: from what a head feeds in and a condition to features, one parameter budget for all.

The default is a residual MLP. The transformer is there to tell what a trunk contributes (Haldar
et al., arXiv 2406.07539): observation tokens made of the condition, an action token after them,
whose output is the action feature.
"""

import math

import torch
from torch import Tensor, nn
from torch.nn import functional

from genpolicy.errors import ConfigError
from genpolicy.policies.settings import WIDTH_UNIT, NetworkConfig

OBSERVATION_TOKENS = 4
ATTENTION_HEADS = 4
# At least a quarter of the budget stays for the feed-forward layers.
LARGEST_ATTENTION_SHARE = 0.75


class Trunk(nn.Module):
    """Residual blocks, each modulated (FiLM) by the condition."""

    def __init__(self, config: NetworkConfig) -> None:
        super().__init__()
        width = config.trunk_width
        self.width = width
        self.modulation = nn.Linear(config.condition_dim, 2 * width * config.trunk_blocks)
        self.first = nn.ModuleList(nn.Linear(width, width) for _ in range(config.trunk_blocks))
        self.second = nn.ModuleList(nn.Linear(width, width) for _ in range(config.trunk_blocks))

    def prepare(self, condition: Tensor) -> Tensor:
        """Shifts and scales (B, 2 W blocks) of conditions (B, C): no feature is needed for them."""
        modulation: Tensor = self.modulation(functional.silu(condition))
        return modulation

    def forward(self, hidden: Tensor, prepared: Tensor) -> Tensor:
        """Features (B, W) to features (B, W), by what `prepare` made: a row for each or for all."""
        modulation = prepared.chunk(2 * len(self.first), dim=-1)
        for index, (first, second) in enumerate(zip(self.first, self.second, strict=True)):
            shift, scale = modulation[2 * index], modulation[2 * index + 1]
            normed = functional.layer_norm(hidden, (self.width,))
            modulated = torch.addcmul(shift, normed, 1.0 + scale)
            hidden = hidden + second(functional.silu(first(modulated)))
        return hidden


class TokenLinear(nn.Linear):
    """A linear layer that runs once per token.

    Attributes:
        tokens: Tokens of one row, for the count of operations.
    """

    def __init__(self, inputs: int, outputs: int, tokens: int) -> None:
        super().__init__(inputs, outputs)
        self.tokens = tokens


class Block(nn.Module):
    """Self-attention and a feed-forward layer, each on normalised tokens, each added."""

    def __init__(self, width: int, hidden: int) -> None:
        super().__init__()
        tokens = OBSERVATION_TOKENS + 1
        self.width = width
        self.attention = TokenLinear(width, 3 * width, tokens)
        self.mixed = TokenLinear(width, width, tokens)
        self.first = TokenLinear(width, hidden, tokens)
        self.second = TokenLinear(hidden, width, tokens)

    def forward(self, tokens: Tensor) -> Tensor:
        """Tokens (B, T, w) to tokens (B, T, w)."""
        rows, count, width = tokens.shape
        normed = functional.layer_norm(tokens, (width,))
        parts = self.attention(normed).reshape(rows, count, 3, ATTENTION_HEADS, -1)
        query, key, value = parts.permute(2, 0, 3, 1, 4)
        scores = query @ key.transpose(-1, -2) / math.sqrt(width // ATTENTION_HEADS)
        seen = (scores.softmax(dim=-1) @ value).transpose(1, 2).reshape(rows, count, width)
        tokens = tokens + self.mixed(seen)
        normed = functional.layer_norm(tokens, (width,))
        result: Tensor = tokens + self.second(functional.silu(self.first(normed)))
        return result


class TransformerTrunk(nn.Module):
    """Attention over observation tokens and an action token, with the MLP trunk's budget."""

    def __init__(self, config: NetworkConfig) -> None:
        super().__init__()
        budget = sum(parameter.numel() for parameter in Trunk(config).parameters())
        width, hidden = _sizes(config, budget)
        self.token_width = width
        self.observed = nn.Linear(config.condition_dim, OBSERVATION_TOKENS * width)
        self.entry = nn.Linear(config.trunk_width, width)
        self.place = nn.Parameter(torch.zeros(OBSERVATION_TOKENS + 1, width))
        self.blocks = nn.ModuleList(Block(width, hidden) for _ in range(config.trunk_blocks))
        self.leave = nn.Linear(width, config.trunk_width)

    def prepare(self, condition: Tensor) -> Tensor:
        """Observation tokens (B, T - 1, w) of conditions (B, C): no feature is needed for them."""
        observed: Tensor = self.observed(functional.silu(condition))
        return observed.reshape(len(condition), OBSERVATION_TOKENS, self.token_width)

    def forward(self, hidden: Tensor, prepared: Tensor) -> Tensor:
        """Features (B, W) to features (B, W), by what `prepare` made: a row for each or for all."""
        observed = prepared.expand(len(hidden), -1, -1)
        tokens = torch.cat([observed, self.entry(hidden)[:, None]], dim=1) + self.place
        for block in self.blocks:
            tokens = block(tokens)
        action = functional.layer_norm(tokens[:, -1], (self.token_width,))
        features: Tensor = hidden + self.leave(action)
        return features


def make_trunk(config: NetworkConfig) -> Trunk | TransformerTrunk:
    """The trunk that the settings name.

    Raises:
        ConfigError: The budget is too small for a transformer.
    """
    return TransformerTrunk(config) if config.trunk == "transformer" else Trunk(config)


def _sizes(config: NetworkConfig, budget: int) -> tuple[int, int]:
    """Widths of tokens and feed-forward layers that fill the budget of the MLP trunk."""
    for width in range(config.trunk_width // WIDTH_UNIT * WIDTH_UNIT, 0, -WIDTH_UNIT):
        tokens = (OBSERVATION_TOKENS + 1) * width
        entry = OBSERVATION_TOKENS * width * (config.condition_dim + 1)
        ends = width * (config.trunk_width + 1) + config.trunk_width * (width + 1)
        block = 4 * width * (width + 1) + width
        spent = tokens + entry + ends + config.trunk_blocks * block
        if spent <= LARGEST_ATTENTION_SHARE * budget:
            cost = config.trunk_blocks * WIDTH_UNIT * (2 * width + 1)
            return width, WIDTH_UNIT * max(1, round((budget - spent) / cost))
    raise ConfigError(
        where="network.trunk",
        found=f"transformer with a budget of {budget} parameters",
        expected="a budget that holds tokens of at least 16 numbers",
        action="Widen the trunk, or use the MLP.",
    )
