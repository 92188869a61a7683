"""Expected evaluations against the counted ones of every sampler, and a solver that takes more."""

import pytest
import torch

from genpolicy.errors import ConfigError
from genpolicy.policies import methods
from genpolicy.policies.ahead import Conditions
from genpolicy.policies.checkpoint import load_checkpoint
from genpolicy.policies.evaluations import EVALUATIONS, allowed_evaluations
from genpolicy.policies.methods import (
    ENERGY_SAMPLERS,
    METHODS,
    SINGLE_EVALUATION,
    generate,
    noise_shape,
)
from genpolicy.policies.ode_samplers import ADAPTIVE_TABLEAUS, sample_adaptive
from genpolicy.policies.samplers import CountedNetwork
from genpolicy.policies.settings import SamplerConfig

CASES = [(method, name) for method in METHODS.values() for name in method.samplers]


def sampler_of(name, steps):
    return SamplerConfig(
        name=name,
        steps=1 if name in SINGLE_EVALUATION else steps,
        population=4 if name in ENERGY_SAMPLERS else 1,
        nfe_cap=100 if name in ADAPTIVE_TABLEAUS else None,
    )


def counted(folder, sampler):
    checkpoint = load_checkpoint(folder)
    network, head = checkpoint.network, checkpoint.config.head
    sizes = network.dimensions
    seen = torch.zeros(2, sizes.observation_horizon, sizes.observation_dim)
    shape = noise_shape(sizes, sampler, head)
    generator = torch.Generator().manual_seed(1)
    with torch.no_grad():
        _, nfe = generate(
            network,
            Conditions(network.encode(seen), torch.arange(2)),
            lambda _: torch.randn(2, *shape, generator=generator),
            sampler=sampler,
            head=head,
            call_rows=lambda count: count,
        )
    return nfe


@pytest.mark.parametrize("steps", [1, 2, 5])
@pytest.mark.parametrize(("method", "name"), CASES)
def test_every_sampler_evaluates_as_often_as_its_definition_says(method, name, steps, folders):
    sampler = sampler_of(name, steps)
    found, allowed = counted(folders[method.name], sampler), allowed_evaluations(sampler)
    assert allowed.nearest(found) == found
    assert (allowed.least == allowed.most) is (name not in ADAPTIVE_TABLEAUS)


@pytest.mark.parametrize(
    ("name", "steps", "expected"),
    [
        ("direct", 1, 1), ("z_zero", 1, 1), ("z_prior", 1, 1), ("offset", 1, 1),
        ("ddpm", 10, 10), ("ddim", 16, 16), ("dpm_2m", 8, 8), ("euler", 4, 4),
        ("heun", 4, 8), ("rk4", 4, 16), ("derivative_free", 16, 17),
        ("midpoint", 4, 8), ("langevin", 100, 101),
    ],
)  # fmt: skip
def test_the_counts_by_hand(name, steps, expected):
    allowed = allowed_evaluations(sampler_of(name, steps))
    assert (allowed.least, allowed.most) == (expected, expected)
    assert allowed.nearest(expected + 5) == expected


@pytest.mark.parametrize(
    ("steps", "cap", "least", "most"),
    [(1, 4, 4, 4), (1, 6, 4, 4), (1, 7, 4, 7), (6, 30, 7, 28), (7, 30, 10, 28), (32, 31, 13, 31)],
)
def test_an_adaptive_solver_takes_one_and_three_a_step_up_to_its_cap(steps, cap, least, most):
    # by hand: steps of 1, 5, 25 times the first one go 1, 6, 31 times as far
    sampler = SamplerConfig(name="bosh3", steps=steps, nfe_cap=cap)
    allowed = allowed_evaluations(sampler)
    assert (allowed.least, allowed.most) == (least, most)
    possible = range(least, most + 1, 3)
    assert [n for n in range(cap + 9) if allowed.nearest(n) == n] == list(possible)


def test_no_velocity_ends_an_adaptive_solver_earlier_than_its_least(folders):
    """A velocity of zero is integrated by the longest steps there are."""
    for steps in (1, 5, 6, 7, 31, 32):
        sampler = SamplerConfig(name="bosh3", steps=steps, nfe_cap=100)
        network = CountedNetwork(lambda x, time: torch.zeros_like(x), cap=100)
        sample_adaptive(
            network, lambda _: torch.ones(1, 2, 2), name="bosh3", steps=steps, tolerance=1e-3
        )
        least = allowed_evaluations(sampler).least
        # the rest that rounding leaves may cost one short step more
        assert network.nfe in (least, least + 3)


def test_a_solver_that_evaluates_once_too_often_differs(monkeypatch, folders):
    def wasteful(velocity, noise, **settings):
        velocity(noise(0), torch.zeros(2))
        return honest(velocity, noise, **settings)

    for name, solver in (("heun", "sample_ode"), ("bosh3", "sample_adaptive")):
        honest = getattr(methods, solver)
        monkeypatch.setattr(methods, solver, wasteful)
        sampler = sampler_of(name, 3)
        found = counted(folders["flow"], sampler)
        assert allowed_evaluations(sampler).nearest(found) == found - 1


def test_every_sampler_is_in_the_table_and_another_is_refused(monkeypatch):
    assert set(EVALUATIONS) == {name for _, name in CASES}
    monkeypatch.delitem(EVALUATIONS, "heun")
    with pytest.raises(ConfigError, match="heun"):
        allowed_evaluations(sampler_of("heun", 2))
