"""Diffusion samplers: from noise to a clean chunk over the levels of the training.

DDPM (Ho et al., arXiv 2006.11239), DDIM with eta 0 (Song et al., arXiv 2010.02502),
DPM-Solver++(2M) (Lu et al., arXiv 2211.01095).
"""

import math

import numpy as np
import torch
from torch import Tensor

from genpolicy.policies.samplers import NetworkFunction, NoiseFunction, refuse_name
from genpolicy.policies.schedules import DiffusionSchedule, trailing_levels

DIFFUSION_SAMPLERS = ("ddpm", "ddim", "dpm_2m")


def sample_diffusion(
    network: NetworkFunction,
    noise: NoiseFunction,
    *,
    schedule: DiffusionSchedule,
    name: str,
    steps: int,
    clip: float | None,
) -> Tensor:
    """Clean chunks from a noise-predicting network.

    Args:
        network: Noise estimate of chunks at time level / T.
        noise: Noise of each sampler step; step 0 is the start, DDPM draws one more per step.
        schedule: Levels of the training.
        name: `ddpm`, `ddim` or `dpm_2m`.
        steps: Sampler steps, trailing spacing.
        clip: Bound of the clean estimate at every step; the noise estimate is recomputed from
            the bounded value. None leaves it free.

    Returns:
        Normalised chunks. Shape (B, K, D).

    Raises:
        ConfigError: Unknown sampler, fewer than one step or more steps than levels.
    """
    if name not in DIFFUSION_SAMPLERS:
        refuse_name(name, DIFFUSION_SAMPLERS)
    visited = trailing_levels(schedule.levels, steps)
    kept = [float(schedule.alpha_bar[level]) for level in visited] + [1.0]
    x = noise(0)
    previous_clean: Tensor | None = None
    for step, level in enumerate(visited):
        now, after = kept[step], kept[step + 1]
        time = schedule.level_time(torch.full(x.shape[:1], level, dtype=x.dtype, device=x.device))
        estimate = network(x, time)
        clean = (x - math.sqrt(1.0 - now) * estimate) / math.sqrt(now)
        if clip is not None:
            clean = clean.clamp(-clip, clip)
        if name == "ddpm":
            x = _ddpm_update(x, clean, now=now, after=after)
            if after < 1.0:
                x = x + _ddpm_deviation(now=now, after=after) * noise(step + 1)
        elif name == "ddim":
            rest = (x - math.sqrt(now) * clean) / math.sqrt(1.0 - now)
            x = math.sqrt(after) * clean + math.sqrt(1.0 - after) * rest
        else:
            x = _dpm_update(x, clean, previous_clean, kept=kept, step=step)
            previous_clean = clean
    return x


def _ddpm_update(x: Tensor, clean: Tensor, *, now: float, after: float) -> Tensor:
    """Mean of one ancestral step."""
    alpha = now / after
    return (
        math.sqrt(after) * (1.0 - alpha) / (1.0 - now) * clean
        + math.sqrt(alpha) * (1.0 - after) / (1.0 - now) * x
    )


def _ddpm_deviation(*, now: float, after: float) -> float:
    """Standard deviation of one ancestral step, the smaller ("fixed small") choice."""
    return math.sqrt((1.0 - after) / (1.0 - now) * (1.0 - now / after))


def _dpm_update(
    x: Tensor, clean: Tensor, previous: Tensor | None, *, kept: list[float], step: int
) -> Tensor:
    """One second-order multistep update in half-log-SNR; the last one is the clean estimate."""
    after = kept[step + 1]
    if after == 1.0:
        return clean
    h = _half_log_snr(after) - _half_log_snr(kept[step])
    blend = clean
    if previous is not None:
        h_before = _half_log_snr(kept[step]) - _half_log_snr(kept[step - 1])
        ratio = h / (2.0 * h_before)
        blend = (1.0 + ratio) * clean - ratio * previous
    scale = math.sqrt((1.0 - after) / (1.0 - kept[step]))
    return scale * x - math.sqrt(after) * math.expm1(-h) * blend


def _half_log_snr(alpha_bar: float) -> float:
    return 0.5 * float(np.log(alpha_bar / (1.0 - alpha_bar)))
