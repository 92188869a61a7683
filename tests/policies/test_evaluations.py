"""Expected evaluations against the counted ones of every sampler, and a solver that takes more."""

import pytest
import torch

from genpolicy.errors import ConfigError
from genpolicy.policies import methods
from genpolicy.policies.checkpoint import load_checkpoint
from genpolicy.policies.evaluations import EVALUATIONS, expected_evaluations
from genpolicy.policies.methods import METHODS, SINGLE_EVALUATION, generate, noise_shape
from genpolicy.policies.settings import SamplerConfig

CASES = [(method, name) for method in METHODS.values() for name in method.samplers]


def sampler_of(name, steps):
    return SamplerConfig(
        name=name,
        steps=1 if name in SINGLE_EVALUATION else steps,
        population=4 if name == "derivative_free" else 1,
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
            network.encode(seen),
            lambda _: torch.randn(2, *shape, generator=generator),
            sampler=sampler,
            head=head,
        )
    return nfe


@pytest.mark.parametrize("steps", [1, 2, 5])
@pytest.mark.parametrize(("method", "name"), CASES)
def test_every_sampler_evaluates_as_often_as_its_definition_says(method, name, steps, folders):
    sampler = sampler_of(name, steps)
    assert counted(folders[method.name], sampler) == expected_evaluations(sampler)


@pytest.mark.parametrize(
    ("name", "steps", "expected"),
    [
        ("direct", 1, 1), ("z_zero", 1, 1), ("z_prior", 1, 1), ("offset", 1, 1),
        ("ddpm", 10, 10), ("ddim", 16, 16), ("dpm_2m", 8, 8), ("euler", 4, 4),
        ("heun", 4, 8), ("rk4", 4, 16), ("derivative_free", 16, 17),
    ],
)  # fmt: skip
def test_the_counts_by_hand(name, steps, expected):
    assert expected_evaluations(sampler_of(name, steps)) == expected


def test_a_solver_that_evaluates_once_too_often_differs(monkeypatch, folders):
    honest = methods.sample_ode

    def wasteful(velocity, noise, *, name, steps):
        velocity(noise(0), torch.zeros(2))
        return honest(velocity, noise, name=name, steps=steps)

    monkeypatch.setattr(methods, "sample_ode", wasteful)
    sampler = sampler_of("heun", 3)
    assert counted(folders["flow"], sampler) == expected_evaluations(sampler) + 1


def test_every_sampler_is_in_the_table_and_another_is_refused(monkeypatch):
    assert set(EVALUATIONS) == {name for _, name in CASES}
    monkeypatch.delitem(EVALUATIONS, "heun")
    with pytest.raises(ConfigError, match="heun"):
        expected_evaluations(sampler_of("heun", 2))
