"""Derivative-free search of an energy: candidates are scored, drawn again by score, and jittered.

Florence et al., arXiv 2109.00137, algorithm of the derivative-free optimiser. One batched pass
scores all candidates of a sample; a sample takes `iterations + 1` passes. A candidate is jittered
along a random subset of the axes, as the negatives of the training are: moved along all at once,
it would be ranked by the axes that the observation decides, and settle between two plans.
"""

import math
from collections.abc import Callable

import torch
from torch import Tensor

# (candidate codes (B, N, Z), time (B,)) -> scores (B, N); an energy ignores the time
ScoreFunction = Callable[[Tensor, Tensor], Tensor]
# iteration -> standard normal (B, N, 2 Z + 2): jitter, which axes it moves, how many, the parents
CandidateNoise = Callable[[int], Tensor]

# Jitter of the first and of the last iteration in units of the box of codes: the original starts
# at 0.33 and halves it; with 6 iterations this is the same.
FIRST_JITTER = 0.33
LAST_JITTER = 0.01


def search_codes(
    score: ScoreFunction, noise: CandidateNoise, *, iterations: int, bound: float
) -> Tensor:
    """The best of the last candidates of each row.

    Args:
        score: Scores of candidate codes, higher is better.
        noise: Noise of an iteration; iteration 0 makes the uniform start.
        iterations: Rounds of drawing again and jittering.
        bound: Half width of the box that candidates stay in.

    Returns:
        Codes (B, Z).
    """
    start = noise(0)
    length = noise_length_to_code(start.shape[2])
    codes = bound * (2.0 * uniform(start[..., :length]) - 1.0)
    time = start.new_zeros(len(start))
    # A product with ones is the running sum, with deterministic kernels on every device.
    ones = torch.ones(start.shape[1], start.shape[1], device=start.device).triu()
    for iteration in range(iterations):
        drawn = noise(iteration + 1)
        reached = torch.softmax(score(codes, time), dim=1) @ ones
        wanted = uniform(drawn[..., -1]) * reached[:, -1:]
        parent = torch.searchsorted(reached, wanted).clamp(max=codes.shape[1] - 1)
        codes = codes.gather(1, parent[..., None].expand_as(codes))
        moved = drawn[..., length : 2 * length] < drawn[..., -2:-1]
        step = jitter(iteration, iterations) * drawn[..., :length]
        codes = (codes + torch.where(moved, step, 0.0)).clamp(-bound, bound)
    best = score(codes, time).argmax(dim=1)
    return codes[torch.arange(len(codes), device=codes.device), best]


def noise_length(code_length: int) -> int:
    """Noise numbers of one candidate and iteration, for codes of that length."""
    return 2 * code_length + 2


def noise_length_to_code(numbers: int) -> int:
    """Length of the code that so many noise numbers are for."""
    return numbers // 2 - 1


def jitter(iteration: int, iterations: int) -> float:
    """Standard deviation of the jitter of an iteration, geometric from first to last."""
    progress = iteration / max(1, iterations - 1)
    return float(FIRST_JITTER * (LAST_JITTER / FIRST_JITTER) ** progress)


def uniform(normal: Tensor) -> Tensor:
    """Uniform numbers of standard normal ones."""
    return 0.5 * (1.0 + torch.erf(normal / math.sqrt(2.0)))
