"""What a diffusion network predicts: noise, v or the clean chunk, behind one conversion.

At a level with a share `kept` of the clean variance, x = sqrt(kept) clean + sqrt(1 - kept) noise.
The three predictions say the same; they differ in what the training weighs.
"""

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor

from genpolicy.policies.schedules import DiffusionSchedule, Gains, noise_gains

Share = float | Tensor


@dataclass(frozen=True)
class Prediction:
    """One kind of prediction.

    Attributes:
        target: What is trained: of clean chunks, noise, and the shares kept of each, (B, 1, 1).
        clean: The clean estimate: of noisy chunks, a prediction, and the share kept, one number
            or one of each chunk, (B, 1, 1).
        gains: Fixed gains around the network at times level / T.
    """

    target: Callable[[Tensor, Tensor, Tensor], Tensor]
    clean: Callable[[Tensor, Tensor, Share], Tensor]
    gains: Callable[..., Gains]


@functools.lru_cache(maxsize=4096)
def scalar(number: float, dtype: torch.dtype) -> Tensor:
    """A number as a tensor without axes.

    torch makes one of a number at every use, which takes longer than a product of a few rows.
    """
    with torch.inference_mode(mode=False):
        return torch.tensor(number, dtype=dtype)


def root(share: Share, dtype: torch.dtype) -> Tensor:
    """Square root of a share, of one number or of one for each chunk."""
    return share.sqrt() if isinstance(share, Tensor) else scalar(math.sqrt(share), dtype)


def _variance(schedule: DiffusionSchedule, time: Tensor, data_std: float) -> tuple[Tensor, Tensor]:
    kept = schedule.kept(time)
    return kept, kept * data_std**2 + 1.0 - kept


def v_gains(schedule: DiffusionSchedule, time: Tensor, *, data_std: float) -> Gains:
    """Gains of v = sqrt(kept) noise - sqrt(1 - kept) clean. Shape of `time`: (B,)."""
    kept, variance = _variance(schedule, time, data_std)
    return Gains(
        inner=variance.rsqrt(),
        skip=(kept * (1.0 - kept)).sqrt() * (1.0 - data_std**2) / variance,
        outer=variance.rsqrt() * data_std,
    )


def clean_gains(schedule: DiffusionSchedule, time: Tensor, *, data_std: float) -> Gains:
    """Gains of the clean chunk itself. Shape of `time`: (B,)."""
    kept, variance = _variance(schedule, time, data_std)
    return Gains(
        inner=variance.rsqrt(),
        skip=kept.sqrt() * data_std**2 / variance,
        outer=((1.0 - kept) / variance).sqrt() * data_std,
    )


# v: Salimans and Ho, arXiv 2202.00512.
PREDICTIONS = {
    "noise": Prediction(
        target=lambda clean, noise, kept: noise,
        clean=lambda x, noise, kept: (x - root(1.0 - kept, x.dtype) * noise) / root(kept, x.dtype),
        gains=noise_gains,
    ),
    "v": Prediction(
        target=lambda clean, noise, kept: kept.sqrt() * noise - (1.0 - kept).sqrt() * clean,
        clean=lambda x, v, kept: root(kept, x.dtype) * x - root(1.0 - kept, x.dtype) * v,
        gains=v_gains,
    ),
    "x0": Prediction(
        target=lambda clean, noise, kept: clean,
        clean=lambda x, clean, kept: clean,
        gains=clean_gains,
    ),
}
