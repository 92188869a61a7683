"""Starting a sampler on the way from noise to a chunk, from what the previous plan still says.

A point of the path is a clean + s noise (`genpolicy.policies.guidance.Path`). Cold, a sampler
starts where only noise is. Warm, it starts at a later time of its own steps, at the point to which
the previous plan's actions in place of the clean chunk lead with the sample's own noise; the
steps before that time are not taken, and their evaluations are not spent. Diffusion models were
first started so in image editing (Meng et al., arXiv 2108.01073).
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from genpolicy.policies.diffusion_samplers import DIFFUSION_SAMPLERS
from genpolicy.policies.guidance import path_of
from genpolicy.policies.prefix import Prefix
from genpolicy.policies.samplers import NoiseFunction
from genpolicy.policies.schedules import squared_cosine, trailing_levels
from genpolicy.policies.settings import HeadConfig, SamplerConfig

Array = NDArray[np.float64]

ROUNDING = 1e-9
"""A product of a strength and a number of steps that is beside a whole number by rounding is it."""


@dataclass(frozen=True)
class WarmStart:
    """Where the rows of one call of a sampler start, on its device.

    Attributes:
        given: Normalised actions of the previous plan. Shape (B, K, D_a).
        skipped: Steps of the sampler that are not taken, >= 1.
    """

    given: Tensor
    skipped: int


def begun(
    noise: NoiseFunction, start: object, *, sampler: SamplerConfig, head: HeadConfig
) -> tuple[NoiseFunction, int]:
    """The noise of a sampler, at step 0 the point where it starts; and the steps it leaves out.

    Args:
        noise: Of each sampler step. Shape (B, K, D_a).
        start: A `WarmStart`; anything else starts from noise alone.
        sampler, head: Settings, of the sampler and of the training.

    Raises:
        ConfigError: The sampler has no path from noise to a chunk on which it could start.
    """
    if not isinstance(start, WarmStart):
        return noise, 0
    path = path_of(sampler, head)

    def draw(step: int) -> Tensor:
        drawn = noise(step)
        if step != 0:
            return drawn
        time = _time(sampler, head, start.skipped)
        a, s = path.shares(drawn.new_full(drawn.shape[:1], time))
        return a * start.given + s * drawn

    return draw, start.skipped


def skipped_steps(strength: float, steps: int) -> int:
    """Steps that a warm start leaves out; at least one is taken, and at strength 1 all are.

    Args:
        strength: Share of the steps that are taken, rounded up to a whole step; in (0, 1].
        steps: Of the sampler.
    """
    return steps - min(max(math.ceil(strength * steps - ROUNDING), 1), steps)


def warm_start_of(
    prefix: Prefix, rows: Sequence[int], normalise: Callable[[Array], Array], *,
    steps: int, device: str,
) -> WarmStart:  # fmt: skip
    """The warm start of some rows of a batch, in this order; `prefix` has a strength below 1."""
    assert prefix.strength is not None
    given = normalise(prefix.actions[list(rows)]).astype(np.float32)
    return WarmStart(torch.from_numpy(given).to(device), skipped_steps(prefix.strength, steps))


def _time(sampler: SamplerConfig, head: HeadConfig, step: int) -> float:
    """Time at which the point of a step lies, as the network is told it."""
    if sampler.name not in DIFFUSION_SAMPLERS:
        return step / sampler.steps
    level = trailing_levels(head.diffusion_levels, sampler.steps)[step]
    return float(squared_cosine(head.diffusion_levels).level_time(torch.tensor(float(level))))
