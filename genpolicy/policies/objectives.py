"""Training objectives, one per method; each sees a network and a batch, none knows a sampler.

Every loss is the mean over the action numbers that are not padding.
"""

from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor, nn

from genpolicy.errors import ContractError
from genpolicy.policies.networks import Dimensions, PolicyNetwork
from genpolicy.policies.predictions import PREDICTIONS
from genpolicy.policies.schedules import squared_cosine, straight_path
from genpolicy.policies.settings import HeadConfig, NetworkConfig


@dataclass(frozen=True)
class Batch:
    """Normalised training windows.

    Attributes:
        observations: Shape (B, H_o, D_o).
        actions: Shape (B, K, D_a).
        weight: 1 for an action that counts, 0 for padding. Shape (B, K, 1).
    """

    observations: Tensor
    actions: Tensor
    weight: Tensor


class Objective(nn.Module):
    """Loss of one method; parameters of its own, if any, are used in training only."""

    def learn_from(self, teacher: PolicyNetwork, network: PolicyNetwork) -> None:
        """Take a frozen teacher, before the first update.

        Raises:
            ContractError: The method has no teacher.
        """
        raise ContractError(
            where=f"the objective {type(self).__name__}",
            found="a teacher",
            expected="none",
            action="Only a distillation has a teacher.",
        )

    def prepare(self, network: PolicyNetwork, data: Batch) -> None:
        """Fix what the network takes from the training split; by default nothing."""

    def updated(self, network: PolicyNetwork) -> None:
        """Follow the network after each update; likewise."""

    def finish(self, network: PolicyNetwork, data: Batch) -> None:
        """Fix what the averaged network takes from it after the last update; likewise."""

    def loss(self, network: PolicyNetwork, batch: Batch, generator: torch.Generator) -> Tensor:
        """Scalar loss of a batch; `generator` is the only source of randomness."""
        raise NotImplementedError


class SquaredError(Objective):
    """Mean squared error of the predicted chunk (behaviour cloning, with or without chunks)."""

    def loss(self, network: PolicyNetwork, batch: Batch, generator: torch.Generator) -> Tensor:
        """Masked mean squared error."""
        predicted = network.evaluate(network.encode(batch.observations))
        return masked_mean((predicted - batch.actions).square(), batch.weight)


class AbsoluteError(Objective):
    """Mean absolute error of the predicted chunk: its optimum is the median, not the mean."""

    def loss(self, network: PolicyNetwork, batch: Batch, generator: torch.Generator) -> Tensor:
        """Masked mean absolute error."""
        predicted = network.evaluate(network.encode(batch.observations))
        return masked_mean((predicted - batch.actions).abs(), batch.weight)


class ConditionalVae(Objective):
    """L1 reconstruction and KL of a latent that a posterior encoder reads from the chunk.

    Source:
        Zhao et al., arXiv 2304.13705 (ACT), with an MLP posterior.
    """

    def __init__(self, dimensions: Dimensions, network: NetworkConfig, head: HeadConfig) -> None:
        super().__init__()
        self._kl_weight = head.kl_weight
        self.posterior = nn.Sequential(
            nn.Linear(dimensions.chunk_numbers + network.condition_dim, head.posterior_width),
            nn.SiLU(),
            nn.Linear(head.posterior_width, head.posterior_width),
            nn.SiLU(),
            nn.Linear(head.posterior_width, 2 * head.latent_dim),
        )

    def loss(self, network: PolicyNetwork, batch: Batch, generator: torch.Generator) -> Tensor:
        """Masked L1 error plus weighted KL per action number."""
        condition = network.encode(batch.observations)
        seen = (batch.actions * batch.weight).flatten(1)
        mean, log_variance = self.posterior(torch.cat([seen, condition], dim=-1)).chunk(2, dim=-1)
        latent = mean + (0.5 * log_variance).exp() * normal_like(mean, generator)
        error = masked_mean(
            (network.evaluate(condition, latent) - batch.actions).abs(), batch.weight
        )
        divergence = 0.5 * (mean.square() + log_variance.exp() - 1.0 - log_variance)
        total: Tensor = error + self._kl_weight * divergence.sum(dim=-1).mean()
        return total


class Denoising(Objective):
    """What `head.prediction` says, at a random level of the squared-cosine schedule."""

    def __init__(self, dimensions: Dimensions, network: NetworkConfig, head: HeadConfig) -> None:
        super().__init__()
        self._schedule = squared_cosine(head.diffusion_levels)
        self._prediction = PREDICTIONS[head.prediction]

    def loss(self, network: PolicyNetwork, batch: Batch, generator: torch.Generator) -> Tensor:
        """Masked mean squared error of the prediction."""
        device = batch.actions.device
        level = torch.randint(
            self._schedule.levels, (len(batch.actions),), generator=generator, device=device
        )
        noise = normal_like(batch.actions, generator)
        noisy = self._schedule.add_noise(batch.actions, noise, level)
        time = self._schedule.level_time(level.to(noisy.dtype))
        predicted = network.evaluate(network.encode(batch.observations), noisy, time)
        kept = self._schedule.kept(time)[:, None, None]
        target = self._prediction.target(batch.actions, noise, kept)
        return masked_mean((predicted - target).square(), batch.weight)


class FlowMatching(Objective):
    """Velocity of the straight path from noise at time 0 to the action at time 1.

    Source:
        Lipman et al., arXiv 2210.02747; Liu et al., arXiv 2209.03003; time uniform.
    """

    def loss(self, network: PolicyNetwork, batch: Batch, generator: torch.Generator) -> Tensor:
        """Masked mean squared error of the velocity."""
        noise = normal_like(batch.actions, generator)
        time = torch.rand(len(noise), generator=generator, dtype=noise.dtype, device=noise.device)
        point, velocity = straight_path(noise, batch.actions, time)
        predicted = network.evaluate(network.encode(batch.observations), point, time)
        return masked_mean((predicted - velocity).square(), batch.weight)


ObjectiveFactory = Callable[[Dimensions, NetworkConfig, HeadConfig], Objective]


def squared_error(dimensions: Dimensions, network: NetworkConfig, head: HeadConfig) -> Objective:
    """`SquaredError`, which needs none of these."""
    return SquaredError()


def absolute_error(dimensions: Dimensions, network: NetworkConfig, head: HeadConfig) -> Objective:
    """`AbsoluteError`, which needs none of these."""
    return AbsoluteError()


def flow_matching(dimensions: Dimensions, network: NetworkConfig, head: HeadConfig) -> Objective:
    """`FlowMatching`, which needs none of these."""
    return FlowMatching()


def masked_mean(values: Tensor, weight: Tensor) -> Tensor:
    """Mean of (B, K, D) over the entries with weight 1; weights have shape (B, K, 1)."""
    return (values * weight).sum() / (weight.sum() * values.shape[-1]).clamp(min=1.0)


def normal_like(values: Tensor, generator: torch.Generator) -> Tensor:
    """Standard normal numbers of the shape, type and device of `values`."""
    return torch.randn(values.shape, generator=generator, dtype=values.dtype, device=values.device)
