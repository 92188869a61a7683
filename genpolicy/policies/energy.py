"""The energy head of implicit behaviour cloning: a score of chunks, trained by contrast.

Florence et al., arXiv 2109.00137. The network scores a condition and the code of a chunk, higher
is better. A code is the chunk's position along the leading principal axes of the training
chunks: uniform candidates fill a box of a few numbers, never one of K times D_a.
"""

import torch
from torch import Tensor, nn
from torch.nn import functional

from genpolicy.errors import ConfigError, ContractError
from genpolicy.policies.networks import Dimensions, Head, HeadInput, PolicyNetwork, Prepared
from genpolicy.policies.objectives import Batch, Objective
from genpolicy.policies.settings import WIDTH_UNIT, HeadConfig, NetworkConfig

# Candidates reach this far beyond the training codes, as the original widens its action bounds.
CODE_BOUND = 1.05
# Negatives around the demonstrated code, in units of the box: from a scale that spans modes to
# one at which two chunks are the same plan; neighbouring scales overlap.
NEGATIVE_SCALES = (0.5, 0.25, 0.125, 0.0625, 0.03, 0.015)
# An axis along which chunks vary less than this share of the widest one carries rounding only,
# and is left out.
SMALLEST_SHARE = 1e-3
SMALLEST_HALF_WIDTH = 1e-6


class ChunkCode(nn.Module):
    """Principal-axes code of a normalised chunk, scaled so that training codes fill [-1, 1].

    Fixed by the training split before the first update and stored with the weights.
    """

    mean: Tensor
    axes: Tensor
    centre: Tensor
    half_width: Tensor
    inverse: Tensor
    used: Tensor

    def __init__(self, dimensions: Dimensions, length: int) -> None:
        super().__init__()
        self.dimensions = dimensions
        self.length = min(length, dimensions.chunk_numbers)
        self.register_buffer("mean", torch.zeros(dimensions.chunk_numbers))
        self.register_buffer("axes", torch.zeros(dimensions.chunk_numbers, self.length))
        self.register_buffer("centre", torch.zeros(self.length))
        self.register_buffer("half_width", torch.ones(self.length))
        self.register_buffer("inverse", torch.ones(self.length))
        self.register_buffer("used", torch.ones(self.length))

    def fit(self, chunks: Tensor) -> None:
        """Take axes and bounds from the training chunks (M, K, D_a), padding included."""
        numbers = chunks.detach().cpu().double().flatten(1)
        mean = numbers.mean(dim=0)
        centred = numbers - mean
        _, vectors = torch.linalg.eigh(centred.T @ centred)
        axes = vectors.flip(1)[:, : self.length]
        # An axis has no sign of its own; its largest entry is made positive.
        largest = axes.gather(0, axes.abs().argmax(dim=0, keepdim=True))
        axes = axes * torch.where(largest < 0, -1.0, 1.0)
        codes = centred @ axes
        low, high = codes.min(dim=0).values, codes.max(dim=0).values
        half_width = (high - low) / 2.0
        least = max(SMALLEST_HALF_WIDTH, SMALLEST_SHARE * float(half_width.max()))
        used = half_width > least
        for name, value in (
            ("mean", mean),
            ("axes", axes),
            ("centre", (high + low) / 2.0),
            ("half_width", torch.where(used, half_width, 0.0)),
            ("inverse", torch.where(used, 1.0 / half_width.clamp(min=least), 0.0)),
            ("used", used),
        ):
            getattr(self, name).copy_(value.to(torch.float32))

    def encode(self, chunks: Tensor) -> Tensor:
        """Codes (B, Z) of normalised chunks (B, K, D_a)."""
        codes: Tensor = (chunks.flatten(1) - self.mean) @ self.axes
        return (codes - self.centre) * self.inverse

    def decode(self, codes: Tensor) -> Tensor:
        """Normalised chunks (B, K, D_a) of codes (B, Z)."""
        numbers: Tensor = (codes * self.half_width + self.centre) @ self.axes.T + self.mean
        return numbers.reshape(
            len(codes), self.dimensions.prediction_horizon, self.dimensions.action_dim
        )


class EnergyHead(Head):
    """Scores candidate codes: a quadratic path and a one-hidden-layer path.

    Both paths read the trunk's features and the code. The quadratic one alone is a normal density
    around any plan; the hidden layer adds what has several.
    """

    def __init__(self, dimensions: Dimensions, config: NetworkConfig, head: HeadConfig) -> None:
        nn.Module.__init__(self)
        width = config.trunk_width
        self.time = None
        self.entry = None
        self.start = nn.Parameter(torch.zeros(width))
        self.code = ChunkCode(dimensions, head.code_dim)
        self._gain = 1.0 / head.conditional_std
        self.direct = nn.Linear(width, 2 * self.code.length)
        spent = sum(parameter.numel() for parameter in self.parameters())
        cost = WIDTH_UNIT * (width + self.code.length + 2)
        hidden = WIDTH_UNIT * round((config.head_parameters - spent) / cost)
        if not hidden >= WIDTH_UNIT:
            raise ConfigError(
                where="network.head_parameters",
                found=str(config.head_parameters),
                expected=f"at least {spent + cost} for this head",
                action="Raise the budget of the head, for every method alike.",
            )
        self.branch_in = nn.Linear(width, hidden)
        self.branch_code = nn.Linear(self.code.length, hidden, bias=False)
        self.branch_out = nn.Linear(hidden, 1, bias=False)

    def context(self, features: Tensor) -> Tensor:
        """What scoring needs of trunk features (B, W): no product of them is left to `score`."""
        hidden = self.branch_in(functional.silu(features))
        return torch.cat([hidden, self.direct(features)], dim=-1)

    def score(self, context: Tensor, codes: Tensor) -> Tensor:
        """Scores (B, N) of contexts (B, ...), or one for all, and candidate codes (B, N, Z)."""
        scaled, hidden, direct = self._entered(context, codes)
        powers = torch.cat([scaled, scaled.square()], dim=-1)
        quadratic = (powers * direct).sum(dim=-1)
        scores: Tensor = quadratic + self.branch_out(functional.silu(hidden)).squeeze(-1)
        return scores

    def slopes(self, context: Tensor, codes: Tensor) -> Tensor:
        """Derivatives of the scores by the codes, and the scores, in closed form.

        The silu's derivative at h is s + h s (1 - s), with s its sigmoid.

        Args:
            context: From `context`. Shape (B, ...), or one for all.
            codes: Candidates. Shape (B, N, Z).

        Returns:
            Shape (B, N, Z + 1), the score last.
        """
        scaled, hidden, direct = self._entered(context, codes)
        linear, square = direct.chunk(2, dim=-1)
        share = hidden.sigmoid()
        bent = (share + hidden * share * (1.0 - share)) * self.branch_out.weight
        slope = linear + 2.0 * scaled * square + bent @ self.branch_code.weight
        slope = slope * (self._gain * self.code.used)
        return torch.cat([slope, self.score(context, codes)[..., None]], dim=-1)

    def _entered(self, context: Tensor, codes: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Scaled codes, the hidden layer before its bend, and the quadratic path's weights."""
        width = self.branch_in.out_features
        entered, direct = context[:, None, :width], context[:, None, width:]
        scaled = codes * (self._gain * self.code.used)
        return scaled, entered + self.branch_code(scaled), direct


class EnergyNetwork(PolicyNetwork):
    """Encoder and trunk of every method, with the energy head."""

    head: EnergyHead

    def __init__(self, dimensions: Dimensions, config: NetworkConfig, head: HeadConfig) -> None:
        self._head_config = head
        super().__init__(dimensions, config, head_input=HeadInput(numbers=0, gains=None))

    def make_head(
        self, dimensions: Dimensions, config: NetworkConfig, head_input: HeadInput
    ) -> Head:
        """The energy head."""
        return EnergyHead(dimensions, config, self._head_config)

    @property
    def code(self) -> ChunkCode:
        """What a candidate's code means."""
        return self.head.code

    def evaluate(
        self, condition: Tensor, values: Tensor | None = None, time: Tensor | None = None
    ) -> Tensor:
        """Scores (B, N) of candidate codes (B, N, Z): one batched pass."""
        if values is None:
            raise ContractError(
                where="an energy network",
                found="no candidates",
                expected="candidate codes to score",
                action="Draw candidates first.",
            )
        return self.finish(self.prepare(condition), values)

    def prepare(self, condition: Tensor, time: Tensor | None = None) -> Prepared:
        """All that conditions (B, C) decide: candidates enter behind the trunk."""
        features = self.trunk(self.head.enter(None, len(condition)), self.trunk.prepare(condition))
        return Prepared(self.head.context(features), None)

    def finish(self, prepared: Prepared, values: Tensor | None) -> Tensor:
        """Scores (B, N) of candidate codes (B, N, Z)."""
        assert values is not None
        return self.head.score(prepared.context, values)

    def climb(self, prepared: Prepared, values: Tensor) -> Tensor:
        """Slopes and scores (B, N, Z + 1) of candidate codes (B, N, Z): one batched pass."""
        return self.head.slopes(prepared.context, values)


class EnergyContrast(Objective):
    """InfoNCE: the demonstrated code against negatives, at temperature 1.

    Negatives of a row are either uniform in the box, as in the original, or normal around a
    centre that is itself drawn around the demonstrated code; and they differ from that code along
    a random subset of the axes. Given centre and subset, code and negatives are exchangeable, so
    in every case the best score is the log-density of codes. The close ones teach what uniform
    ones never come near to. Without subsets, axes that the observation decides give a negative
    away, and nothing is learned along those where several plans part.

    A chunk is scored whole, so its padding is part of it; a row counts by its share of actions
    that are not padding.
    """

    def __init__(self, dimensions: Dimensions, network: NetworkConfig, head: HeadConfig) -> None:
        super().__init__()
        self._negatives = head.energy_negatives

    def prepare(self, network: PolicyNetwork, data: Batch) -> None:
        """Fix the code by the training split."""
        _energy(network).code.fit(data.actions)

    def loss(self, network: PolicyNetwork, batch: Batch, generator: torch.Generator) -> Tensor:
        """Cross-entropy of the demonstrated code among its negatives, mean over rows."""
        scored = _energy(network)
        truth = scored.code.encode(batch.actions)[:, None]
        codes = torch.cat([truth, self.negatives(truth, generator)], dim=1)
        scores = scored.evaluate(scored.encode(batch.observations), codes)
        weight = batch.weight.mean(dim=(1, 2))
        error = torch.logsumexp(scores, dim=1) - scores[:, 0]
        total: Tensor = (error * weight).sum() / weight.sum().clamp(min=1.0)
        return total

    def negatives(self, truth: Tensor, generator: torch.Generator) -> Tensor:
        """Codes (B, N, Z) to hold against the demonstrated ones (B, 1, Z)."""
        rows, _, length = truth.shape
        shape, device = (rows, self._negatives, length), truth.device
        options = truth.new_tensor((0.0, *NEGATIVE_SCALES))
        chosen = torch.randint(len(options), (rows, 1, 1), generator=generator, device=device)
        scale = options[chosen]
        centre = truth + scale * torch.randn(truth.shape, generator=generator, device=device)
        around = centre + scale * torch.randn(shape, generator=generator, device=device)
        uniform = torch.rand(shape, generator=generator, device=device) * 2.0 - 1.0
        drawn = torch.where(chosen == 0, CODE_BOUND * uniform, around)
        share = torch.rand((rows, 1, 1), generator=generator, device=device)
        moved = torch.rand(truth.shape, generator=generator, device=device) < share
        return torch.where(moved, drawn, truth)


def _energy(network: PolicyNetwork) -> EnergyNetwork:
    assert isinstance(network, EnergyNetwork)
    return network
