"""The derivative-free search: finds known maxima, keeps modes, stays in its box."""

import math

import numpy as np
import pytest
import torch

from genpolicy.policies.derivative_free import (
    FIRST_JITTER,
    LAST_JITTER,
    jitter,
    search_codes,
)
from genpolicy.policies.energy import (
    CODE_BOUND,
)


def noise_of(rows, population, length, seed=0):
    def draw(step):
        generator = torch.Generator().manual_seed(1000 * seed + step)
        return torch.randn(rows, population, 2 * length + 2, generator=generator)

    return draw


def test_search_finds_the_maximum_of_a_known_energy():
    peak = torch.tensor([0.4, -0.7, 0.1])

    def score(codes, time):
        return -0.5 * ((codes - peak) / 0.05).square().sum(dim=-1)

    found = search_codes(score, noise_of(6, 256, 3), iterations=8, bound=CODE_BOUND)
    assert float((found - peak).abs().max()) < 0.05


def test_search_keeps_both_modes_over_samples():
    def score(codes, time):
        return torch.logsumexp(
            torch.stack([-(codes - p).square().sum(-1) / 0.02 for p in (-0.5, 0.5)]), dim=0
        )

    found = search_codes(score, noise_of(400, 32, 2), iterations=8, bound=CODE_BOUND)
    assert float((found.abs() - 0.5).abs().median()) < 0.05
    assert 0.35 < float((found[:, 0] > 0).float().mean()) < 0.65


def test_search_stays_in_its_box_and_repeats():
    def score(codes, time):
        return 100.0 * codes.sum(dim=-1)

    one, two = (search_codes(score, noise_of(3, 16, 2), iterations=5, bound=1.0) for _ in range(2))
    assert torch.equal(one, two)
    assert float(one.max()) == 1.0
    other = search_codes(score, noise_of(3, 16, 2, seed=1), iterations=0, bound=1.0)
    assert not torch.equal(one, other)


def test_parents_are_drawn_in_proportion_to_their_scores():
    """Golden: with probabilities 0.8 and 0.2 the share of the first parent is 0.8."""
    codes_seen = []

    def score(codes, time):
        codes_seen.append(codes)
        return torch.where(codes[..., 0] > 0, math.log(4.0), 0.0)

    rows = 400
    noise = noise_of(rows, 64, 1)

    def start_at_ends(step):
        drawn = noise(step)
        if step == 0:
            half = torch.where(torch.arange(64) % 2 == 0, 6.0, -6.0)
            drawn[..., 0] = half
        return drawn * torch.tensor([float(step == 0), 1.0, 1.0, 1.0])

    search_codes(score, start_at_ends, iterations=1, bound=1.0)
    assert float((codes_seen[1][..., 0] > 0).float().mean()) == pytest.approx(0.8, abs=0.01)


def test_jitter_halves_with_six_iterations():
    """Golden: the original halves 0.33; six geometric steps to 0.01 are nearly that."""
    widths = [jitter(i, 6) for i in range(6)]
    assert widths[0] == FIRST_JITTER
    assert widths[-1] == pytest.approx(LAST_JITTER)
    assert np.allclose(np.divide(widths[1:], widths[:-1]), 0.5, atol=0.01)
