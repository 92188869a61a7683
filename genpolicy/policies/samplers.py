"""Samplers: from noise to a clean chunk, knowing only a network function and a noise function.

DDPM (Ho et al., arXiv 2006.11239), DDIM with eta 0 (Song et al., arXiv 2010.02502),
DPM-Solver++(2M) (Lu et al., arXiv 2211.01095); Euler, Heun and Runge-Kutta 4 for the flow.
The number of network evaluations is counted by wrapping the network, never derived.
"""

import math
from collections.abc import Callable

import numpy as np
import torch
from torch import Tensor

from genpolicy.errors import ConfigError
from genpolicy.policies.schedules import DiffusionSchedule, trailing_levels

# (chunks (B, K, D), time (B,)) -> noise estimate or velocity (B, K, D)
NetworkFunction = Callable[[Tensor, Tensor], Tensor]
# sampler step -> standard normal (B, K, D); step 0 is the start
NoiseFunction = Callable[[int], Tensor]

DIFFUSION_SAMPLERS = ("ddpm", "ddim", "dpm_2m")
ODE_SAMPLERS = ("euler", "heun", "rk4")


class CountedNetwork:
    """A network function that counts its evaluations.

    Attributes:
        nfe: Evaluations so far; one call is one evaluation, whatever its batch size.
    """

    def __init__(self, network: NetworkFunction) -> None:
        self._network = network
        self.nfe = 0

    def __call__(self, chunks: Tensor, time: Tensor) -> Tensor:
        """One counted evaluation."""
        self.nfe += 1
        return self._network(chunks, time)


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
        _unknown(name, DIFFUSION_SAMPLERS)
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


def sample_ode(velocity: NetworkFunction, noise: NoiseFunction, *, name: str, steps: int) -> Tensor:
    """Clean chunks by integrating the flow from time 0 (noise) to time 1 (action).

    Args:
        velocity: Velocity of chunks at a flow time.
        noise: Noise function; only step 0, the start, is drawn.
        name: `euler`, `heun` or `rk4`.
        steps: Equal steps.

    Returns:
        Normalised chunks, not clipped. Shape (B, K, D).

    Raises:
        ConfigError: Unknown sampler or fewer than one step.
    """
    if name not in ODE_SAMPLERS:
        _unknown(name, ODE_SAMPLERS)
    if not steps >= 1:
        raise ConfigError(
            where="sampler_steps",
            found=str(steps),
            expected="at least 1",
            action="Choose at least one sampler step.",
        )
    x = noise(0)
    h = 1.0 / steps

    def slope(point: Tensor, flow_time: float) -> Tensor:
        time = torch.full(point.shape[:1], flow_time, dtype=point.dtype, device=point.device)
        return velocity(point, time)

    for step in range(steps):
        start = step / steps
        k1 = slope(x, start)
        if name == "euler":
            x = x + h * k1
        elif name == "heun":
            k2 = slope(x + h * k1, start + h)
            x = x + h / 2.0 * (k1 + k2)
        else:
            k2 = slope(x + h / 2.0 * k1, start + h / 2.0)
            k3 = slope(x + h / 2.0 * k2, start + h / 2.0)
            k4 = slope(x + h * k3, start + h)
            x = x + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
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


def _unknown(name: str, known: tuple[str, ...]) -> None:
    raise ConfigError(
        where="sampler.name",
        found=repr(name),
        expected=f"one of {', '.join(known)}",
        action="Choose a sampler that fits the method.",
    )
