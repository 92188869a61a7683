"""Langevin search: exact slopes, known optima, bounded moves, and modes of a trained energy."""

from itertools import pairwise

import pytest
import torch

from genpolicy.policies.checkpoint import load_checkpoint
from genpolicy.policies.energy import CODE_BOUND
from genpolicy.policies.langevin import (
    FIRST_STEP,
    LARGEST_MOVE,
    LAST_STEP,
    climb_codes,
    step_size,
)
from genpolicy.policies.policy import load_policy
from genpolicy.policies.settings import SamplerConfig
from genpolicy.policies.training import train

ROWS, CANDIDATES, LENGTH = 3, 64, 2


def noise_of(seed=0, scale=1.0):
    def noise(step):
        generator = torch.Generator().manual_seed(1000 * seed + step)
        drawn = torch.randn(ROWS, CANDIDATES, LENGTH, generator=generator)
        return drawn if step == 0 else scale * drawn

    return noise


def well(centre, width=0.05):
    """Slopes and scores of a normal density around a plan."""

    def slopes(codes, time):
        apart = centre - codes
        score = -(apart**2).sum(dim=-1, keepdim=True) / (2.0 * width**2)
        return torch.cat([apart / width**2, score], dim=-1)

    return slopes


def test_the_slopes_are_the_derivatives_of_the_scores(folders):
    """Against reverse mode, in float64; a code axis that carries nothing has no slope."""
    network = load_checkpoint(folders["ibc"]).network.double()
    torch.manual_seed(0)
    head = network.head
    context = head.context(torch.randn(4, 48, dtype=torch.float64))
    codes = torch.randn(4, 7, network.code.length, dtype=torch.float64, requires_grad=True)
    head.code.used[-1] = 0.0
    score = head.score(context, codes)
    (expected,) = torch.autograd.grad(score.sum(), codes, retain_graph=True)
    found = head.slopes(context, codes)
    assert torch.allclose(found[..., :-1], expected, atol=1e-12, rtol=1e-12)
    assert torch.equal(found[..., -1], score)
    assert (found[..., -2] == 0).all() and (found[..., :-2] != 0).any()
    numbers = (found[..., :-1] - 2.0 * expected).abs().max()
    assert numbers > 1e-3, "a slope of another size would be seen"


def test_steps_shrink_from_the_first_to_the_last():
    """Golden by hand: a quarter of the way from last to first in the middle of three."""
    assert step_size(0, 3) == FIRST_STEP == 0.1 and step_size(2, 3) == LAST_STEP == 1e-5
    assert step_size(1, 3) == pytest.approx(1e-5 + 0.25 * (0.1 - 1e-5))
    assert step_size(0, 1) == 0.1


@pytest.mark.parametrize("place", [-0.7, 0.0, 0.4])
def test_it_climbs_to_the_top_of_a_well(place):
    centre = torch.tensor([place, -place])
    found = climb_codes(well(centre), noise_of(), iterations=100, bound=CODE_BOUND)
    assert (found - centre).abs().max() < 0.02
    unmoved = climb_codes(well(centre), noise_of(), iterations=0, bound=CODE_BOUND)
    assert (unmoved - centre).abs().max() > 0.02, "the start alone must not be enough"


def test_the_slope_pulls_and_the_noise_alone_does_not():
    """The fault: a search that forgets its slope, with the noise of the last steps."""

    def flat(codes, time):
        found = well(torch.zeros(LENGTH))(codes, time)
        return torch.cat([0.0 * found[..., :-1], found[..., -1:]], dim=-1)

    def mean_distance(slopes):
        seen = []

        def spied(codes, time):
            seen.append(codes)
            return slopes(codes, time)

        climb_codes(spied, noise_of(), iterations=60, bound=CODE_BOUND)
        return float(seen[-1].norm(dim=-1).mean())

    assert mean_distance(well(torch.zeros(LENGTH))) < 0.1 < 0.4 < mean_distance(flat)


def test_no_move_is_longer_than_its_bound_and_candidates_stay_in_the_box():
    seen = []

    def steep(codes, time):
        seen.append(codes)
        return torch.cat([torch.full_like(codes, 1e6), codes.sum(dim=-1, keepdim=True)], dim=-1)

    found = climb_codes(steep, noise_of(), iterations=30, bound=CODE_BOUND)
    moves = [(b - a).abs().max() for a, b in pairwise(seen)]
    assert len(seen) == 31 and max(moves) <= LARGEST_MOVE * CODE_BOUND * (1 + 1e-6)
    assert max(float(codes.abs().max()) for codes in seen) <= CODE_BOUND
    assert torch.allclose(found, torch.full_like(found, CODE_BOUND))


@pytest.mark.parametrize(("gap", "share"), [(0.0, 0.5), (1.0, 0.7311), (30.0, 1.0)])
def test_the_last_candidates_are_drawn_by_the_weight_of_their_scores(gap, share):
    """Golden: 1 / (1 + exp(-gap)) of two equal crowds."""

    def two(codes, time):
        score = gap * (codes[..., :1] > 0)
        return torch.cat([torch.zeros_like(codes), score], dim=-1)

    def noise(step):
        generator = torch.Generator().manual_seed(step)
        drawn = torch.randn(4000, 16, 1, generator=generator)
        if step == 0:
            drawn = drawn.abs() * torch.tensor([1.0, -1.0]).repeat(8)[:, None]
        return drawn

    found = climb_codes(two, noise, iterations=0, bound=CODE_BOUND)
    assert (found > 0).float().mean() == pytest.approx(share, abs=0.03)


def test_a_trained_energy_keeps_both_modes(tmp_path, two_mode_windows, request_for):
    windows = two_mode_windows(1024)
    train(tmp_path / "ibc", request_for("ibc", updates=600), windows=windows)
    sampler = SamplerConfig(name="langevin", steps=50, population=32)
    policy = load_policy(tmp_path / "ibc", sampler=sampler)
    drawn = policy.sample(
        torch.zeros(1, 2, 3).numpy().astype("float64"), noise_names=[("modes",)], candidates=100
    )
    first = drawn.actions[0, :, 0, 0]
    assert 0.1 < (first > 0).mean() < 0.9
    assert (abs(abs(first) - 1.0) < 0.3).mean() > 0.9 and drawn.nfe == 51
