"""Langevin search of an energy: candidates climb the score with noise, in steps that grow small.

Florence et al., arXiv 2109.00137, appendix on Langevin sampling. Where the derivative-free search
draws good candidates again, this one moves every candidate along the slope of the score:

    code <- code + step * (slope / 2 + noise),    step from 0.1 to 1e-5, quadratic in between

A move along an axis is at most a tenth of half the box, and candidates stay in the box. Of the last
candidates one is drawn by its score: the best of chains that end in several modes would always be
of the same mode, which is what the original returns. One batched pass gives scores and slopes of
all candidates; a sample takes `iterations + 1` of them.
"""

from collections.abc import Callable

import torch
from torch import Tensor

from genpolicy.policies.derivative_free import CandidateNoise, uniform

# (candidate codes (B, N, Z), time (B,)) -> slopes of the score and the score (B, N, Z + 1)
SlopeFunction = Callable[[Tensor, Tensor], Tensor]

LANGEVIN = "langevin"
FIRST_STEP, LAST_STEP, POWER = 0.1, 1e-5, 2.0
SLOPE_SHARE = 0.5
SMALLEST = 1e-6
LARGEST_MOVE = 0.1
"""Of half the width of the box, along one axis."""


def climb_codes(
    slopes: SlopeFunction, noise: CandidateNoise, *, iterations: int, bound: float
) -> Tensor:
    """One of the last candidates of each row, drawn with the weight exp(score).

    Args:
        slopes: Slopes and scores of candidate codes, higher is better.
        noise: Standard normal numbers (B, N, Z) of an iteration; 0 makes the uniform start.
        iterations: Moves of every candidate.
        bound: Half width of the box that candidates stay in.

    Returns:
        Codes (B, Z).
    """
    start = noise(0)
    codes = bound * (2.0 * uniform(start) - 1.0)
    time, most = start.new_zeros(len(start)), LARGEST_MOVE * bound
    for iteration in range(iterations):
        slope = slopes(codes, time)[..., :-1]
        move = step_size(iteration, iterations) * (SLOPE_SHARE * slope + noise(iteration + 1))
        codes = (codes + move.clamp(-most, most)).clamp(-bound, bound)
    # The largest of scores with Gumbel noise is a draw by their weights.
    level = uniform(noise(iterations + 1)[..., 0]).clamp(SMALLEST, 1.0 - SMALLEST)
    chosen = (slopes(codes, time)[..., -1] - (-level.log()).log()).argmax(dim=1)
    return codes[torch.arange(len(codes), device=codes.device), chosen]


def step_size(iteration: int, iterations: int) -> float:
    """Length of a step, from the first to the last one."""
    left = 1.0 - iteration / max(1, iterations - 1)
    return float(LAST_STEP + (FIRST_STEP - LAST_STEP) * left**POWER)
