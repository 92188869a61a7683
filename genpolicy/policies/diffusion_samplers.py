"""Diffusion samplers: from noise to a clean chunk over the levels of the training.

Every sampler is one update function of the same step; the walk over the levels, the conversion
of the prediction and the bound of the clean estimate are common. DDPM (Ho et al., arXiv
2006.11239), DDIM (Song et al., arXiv 2010.02502), DPM-Solver++ of first and second order and
its stochastic form (Lu et al., arXiv 2211.01095).
"""

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass

from torch import Tensor

from genpolicy.policies.predictions import PREDICTIONS, root
from genpolicy.policies.samplers import NetworkFunction, NoiseFunction, refuse_name
from genpolicy.policies.schedules import DiffusionSchedule, trailing_levels
from genpolicy.policies.settings import SamplerConfig


@dataclass(frozen=True)
class Step:
    """One step from a noise level to the next lower one, or to the clean chunk.

    Attributes:
        x: Noisy chunks. Shape (B, K, D).
        clean: Estimate of the clean chunks at this level.
        clean_before: That of the step before; None at the first.
        now: Share of the clean variance left at this level, < 1.
        after: At the next; 1 at the end.
        before: At the level of the step before; NaN at the first.
        eta: Share of the ancestral noise that DDIM adds.
        draw: New standard normal numbers for this step. Shape (B, K, D).
    """

    x: Tensor
    clean: Tensor
    clean_before: Tensor | None
    now: float
    after: float
    before: float
    eta: float
    draw: Callable[[], Tensor]

    @property
    def deviation(self) -> float:
        """Standard deviation of the ancestral noise, the smaller ("fixed small") choice."""
        return math.sqrt((1.0 - self.after) / (1.0 - self.now) * (1.0 - self.now / self.after))

    @property
    def length(self) -> float:
        """Length in half the logarithm of signal to noise; where noise is left after it."""
        return _half_log_snr(self.after) - _half_log_snr(self.now)


def _ddpm(step: Step) -> Tensor:
    """One ancestral step."""
    alpha = step.now / step.after
    mean = (
        math.sqrt(step.after) * (1.0 - alpha) / (1.0 - step.now) * step.clean
        + math.sqrt(alpha) * (1.0 - step.after) / (1.0 - step.now) * step.x
    )
    return mean + step.deviation * step.draw() if step.after < 1.0 else mean


def _ddim(step: Step) -> Tensor:
    """One step with the noise that the bounded clean estimate leaves, and eta of fresh noise."""
    kind, fresh = step.x.dtype, step.eta * step.deviation
    rest = (step.x - root(step.now, kind) * step.clean) / root(1.0 - step.now, kind)
    x = root(step.after, kind) * step.clean + root(1.0 - step.after - fresh**2, kind) * rest
    return x + fresh * step.draw() if fresh > 0.0 else x


def _dpm_1(step: Step) -> Tensor:
    """First order: exact where the clean estimate does not change along the step."""
    return _exponential(step, step.clean)


def _dpm_2m(step: Step) -> Tensor:
    """Second order from the estimate of the step before; the last step is of first order."""
    return _exponential(step, _extrapolated(step))


def _dpm_sde(step: Step) -> Tensor:
    """As `_dpm_2m` for the diffusion's stochastic equation: the noise is renewed on the way."""
    if step.after == 1.0:
        return step.clean
    h = step.length
    scale = math.sqrt((1.0 - step.after) / (1.0 - step.now)) * math.exp(-h)
    x = scale * step.x - math.sqrt(step.after) * math.expm1(-2.0 * h) * _extrapolated(step)
    return x + math.sqrt(-(1.0 - step.after) * math.expm1(-2.0 * h)) * step.draw()


def _exponential(step: Step, clean: Tensor) -> Tensor:
    if step.after == 1.0:
        return step.clean
    scale = math.sqrt((1.0 - step.after) / (1.0 - step.now))
    return scale * step.x - math.sqrt(step.after) * math.expm1(-step.length) * clean


def _extrapolated(step: Step) -> Tensor:
    """The clean estimate half a step ahead, along the line through the last two."""
    if step.clean_before is None or step.after == 1.0:
        return step.clean
    ratio = step.length / (2.0 * (_half_log_snr(step.now) - _half_log_snr(step.before)))
    return (1.0 + ratio) * step.clean - ratio * step.clean_before


UPDATES: dict[str, Callable[[Step], Tensor]] = {
    "ddim": _ddim,
    "ddpm": _ddpm,
    "dpm_1": _dpm_1,
    "dpm_2m": _dpm_2m,
    "dpm_sde": _dpm_sde,
}
DIFFUSION_SAMPLERS = tuple(UPDATES)


def sample_diffusion(
    network: NetworkFunction,
    noise: NoiseFunction,
    *,
    schedule: DiffusionSchedule,
    sampler: SamplerConfig,
    prediction: str = "noise",
    skipped: int = 0,
) -> Tensor:
    """Clean chunks from a trained diffusion network.

    Args:
        network: Its prediction of chunks at time level / T.
        noise: Noise of each sampler step; step 0 is the start, stochastic ones draw one a step.
        schedule: Levels of the training.
        sampler: Name, steps (trailing spacing), `eta`, and `clip`: bound of the clean estimate
            at every step, from which the noise estimate is computed again.
        prediction: What the network predicts, a key of `PREDICTIONS`.
        skipped: The first steps, of most noise, that are not taken: step 0 of the noise lies
            behind them.

    Returns:
        Normalised chunks. Shape (B, K, D).

    Raises:
        ConfigError: Unknown sampler, fewer than one step or more steps than levels.
    """
    if sampler.name not in UPDATES:
        refuse_name(sampler.name, DIFFUSION_SAMPLERS)
    update, kind = UPDATES[sampler.name], PREDICTIONS[prediction]
    visited = trailing_levels(schedule.levels, sampler.steps)[skipped:]
    kept = [float(schedule.alpha_bar[level]) for level in visited] + [1.0]
    x = noise(0)
    before: Tensor | None = None
    times = schedule.level_time(x.new_tensor(visited))[:, None].expand(-1, len(x)).unbind()
    for index, time in enumerate(times):
        clean = kind.clean(x, network(x, time), kept[index])
        if sampler.clip is not None:
            clean = clean.clamp(-sampler.clip, sampler.clip)
        step = Step(
            x=x,
            clean=clean,
            clean_before=before,
            now=kept[index],
            after=kept[index + 1],
            before=kept[index - 1] if index else math.nan,
            eta=sampler.eta,
            draw=functools.partial(noise, index + 1),
        )
        x, before = update(step), clean
    return x


def _half_log_snr(alpha_bar: float) -> float:
    return 0.5 * math.log(alpha_bar / (1.0 - alpha_bar))
