"""Noise schedules and paths between noise and action; pure tables, no sampler, no network.

Flow time is 0 at noise and 1 at action, everywhere in this project.
"""

import functools
import math
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from genpolicy.errors import ConfigError

COSINE_OFFSET = 0.008
LARGEST_BETA = 0.999


@dataclass(frozen=True)
class DiffusionSchedule:
    """Squared-cosine noise levels 0 (least noise) to T - 1.

    Attributes:
        alpha_bar: Share of the clean chunk's variance left at each level. Shape (T,), float64.

    Source:
        Nichol and Dhariwal, arXiv 2102.09672, with beta capped at 0.999.
    """

    alpha_bar: NDArray[np.float64]

    @property
    def levels(self) -> int:
        """Number of noise levels T."""
        return len(self.alpha_bar)

    def level_time(self, level: Tensor) -> Tensor:
        """The network's time input of levels: level / T, in [0, 1)."""
        return level / self.levels

    def kept(self, time: Tensor) -> Tensor:
        """Share of the clean variance left at times level / T. Shapes (B,)."""
        table = torch.tensor(self.alpha_bar, dtype=time.dtype, device=time.device)
        return table[(time * self.levels).round().long()]

    def add_noise(self, clean: Tensor, noise: Tensor, level: Tensor) -> Tensor:
        """Chunks at a noise level: sqrt(abar) clean + sqrt(1 - abar) noise.

        Args:
            clean: Normalised chunks. Shape (B, K, D).
            noise: Standard normal. Shape (B, K, D).
            level: Level of each chunk, integer. Shape (B,).
        """
        table = torch.tensor(self.alpha_bar, dtype=clean.dtype, device=clean.device)
        kept = table[level].reshape(-1, *[1] * (clean.ndim - 1))
        return kept.sqrt() * clean + (1.0 - kept).sqrt() * noise


@functools.lru_cache(maxsize=16)
def squared_cosine(levels: int) -> DiffusionSchedule:
    """The schedule with `levels` noise levels."""

    def remaining(progress: float) -> float:
        angle = (progress + COSINE_OFFSET) / (1.0 + COSINE_OFFSET) * math.pi / 2.0
        return math.cos(angle) ** 2

    betas = [
        min(1.0 - remaining((k + 1) / levels) / remaining(k / levels), LARGEST_BETA)
        for k in range(levels)
    ]
    alpha_bar = np.cumprod(1.0 - np.array(betas)).astype(np.float64)
    alpha_bar.flags.writeable = False
    return DiffusionSchedule(alpha_bar)


@dataclass(frozen=True)
class Gains:
    """Fixed gains around a network F: estimate = skip * x + outer * F(inner * x).

    With F = 0 the estimate is the best linear one for data of the assumed spread around zero;
    F learns the rest, at unit scale. Each has one entry per row. Shape (B,).

    Source:
        Karras et al., arXiv 2206.00364, for noise estimates and for velocities.
    """

    inner: Tensor
    skip: Tensor
    outer: Tensor


def noise_gains(schedule: DiffusionSchedule, time: Tensor, *, data_std: float) -> Gains:
    """Gains of a noise estimate at times level / T. Shape of `time`: (B,)."""
    kept = schedule.kept(time)
    variance = kept * data_std**2 + 1.0 - kept
    return Gains(
        inner=variance.rsqrt(),
        skip=(1.0 - kept).sqrt() / variance,
        outer=(kept / variance).sqrt() * data_std,
    )


def flow_gains(time: Tensor, *, data_std: float) -> Gains:
    """Gains of a velocity at flow times. Shape of `time`: (B,)."""
    variance = (time * data_std).square() + (1.0 - time).square()
    return Gains(
        inner=variance.rsqrt(),
        skip=(time * data_std**2 - (1.0 - time)) / variance,
        outer=variance.rsqrt() * data_std,
    )


def trailing_levels(levels: int, steps: int) -> list[int]:
    """The noise levels that a sampler of `steps` steps visits, from T - 1 downwards.

    Trailing spacing: the first one is pure noise, as the start of the sampler is.

    Raises:
        ConfigError: Fewer than one step, or more steps than levels.
    """
    if not 1 <= steps <= levels:
        raise ConfigError(
            where="sampler_steps",
            found=str(steps),
            expected=f"between 1 and the {levels} levels of the training",
            action="Choose fewer sampler steps; more than the training levels add nothing.",
        )
    return [round(levels - index * levels / steps) - 1 for index in range(steps)]


def straight_path(noise: Tensor, clean: Tensor, flow_time: Tensor) -> tuple[Tensor, Tensor]:
    """Point and velocity on the straight path from noise (time 0) to the clean chunk (time 1).

    Args:
        noise: Standard normal. Shape (B, K, D).
        clean: Normalised chunks. Shape (B, K, D).
        flow_time: Time of each chunk in [0, 1]. Shape (B,).

    Returns:
        The point and its velocity `clean - noise`. Shapes (B, K, D).
    """
    time = flow_time.reshape(-1, *[1] * (clean.ndim - 1))
    return (1.0 - time) * noise + time * clean, clean - noise
