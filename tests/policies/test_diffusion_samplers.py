"""Diffusion samplers against diffusers and an analytic Gaussian."""

import pytest
import torch
from diffusers import DDIMScheduler, DDPMScheduler, DPMSolverMultistepScheduler

from genpolicy.errors import ConfigError
from genpolicy.policies.diffusion_samplers import DIFFUSION_SAMPLERS, sample_diffusion
from genpolicy.policies.samplers import CountedNetwork
from genpolicy.policies.schedules import (
    squared_cosine,
)

LEVELS = 100


MEAN, STD = 0.4, 0.3


COMMON = {"num_train_timesteps": LEVELS, "beta_schedule": "squaredcos_cap_v2"}


def fixed_noise(shape=(5, 4, 3)):
    generator = torch.Generator().manual_seed(7)
    drawn = [
        torch.randn(shape, generator=generator, dtype=torch.float64) for _ in range(LEVELS + 1)
    ]
    return lambda step: drawn[step]


def curved_network(x, time):
    """Bounded, non-linear, time-dependent: any indexing mistake shows."""
    return torch.tanh(1.3 * x + time[:, None, None]) + 0.1 * x.flip(-1)


def with_scheduler(scheduler, steps, noise, network=curved_network, **step_arguments):
    scheduler.set_timesteps(steps)
    x = noise(0)
    for level in scheduler.timesteps:
        time = torch.full(x.shape[:1], float(level) / LEVELS, dtype=x.dtype)
        estimate = network(x, time)
        x = scheduler.step(estimate, level, x, **step_arguments).prev_sample
    return x


@pytest.mark.parametrize("steps", [5, 10, 20, 50, 100])
@pytest.mark.parametrize("clip", [None, 1.0])
def test_ddim_equals_diffusers(steps, clip):
    # without the clip, a network that is no denoiser grows without bound: use the exact one
    network = gaussian_noise_estimate if clip is None else curved_network
    noise = fixed_noise()
    scheduler = DDIMScheduler(
        **COMMON, clip_sample=clip is not None, timestep_spacing="trailing", set_alpha_to_one=True
    )
    arguments = {"eta": 0.0, "use_clipped_model_output": True}
    expected = with_scheduler(scheduler, steps, noise, network, **arguments)
    found = sample_diffusion(
        network, noise, schedule=squared_cosine(LEVELS), name="ddim", steps=steps, clip=clip
    )
    assert torch.allclose(found, expected, atol=1e-5, rtol=1e-5)


@pytest.mark.parametrize("steps", [10, 50, 100])
def test_ddpm_equals_diffusers(steps, monkeypatch):
    noise = fixed_noise()
    scheduler = DDPMScheduler(**COMMON, clip_sample=True, timestep_spacing="trailing")
    calls = iter(range(1, LEVELS + 1))
    monkeypatch.setattr(
        "diffusers.schedulers.scheduling_ddpm.randn_tensor",
        lambda *_, **__: noise(next(calls)),
    )
    expected = with_scheduler(scheduler, steps, noise)
    found = sample_diffusion(
        curved_network, noise, schedule=squared_cosine(LEVELS), name="ddpm", steps=steps, clip=1.0
    )
    assert torch.allclose(found, expected, atol=1e-5, rtol=1e-5)


@pytest.mark.parametrize("steps", [5, 10, 20])
def test_dpm_solver_equals_diffusers(steps):
    # thresholding with a largest value of 1 is exactly the clip to [-1, 1]
    noise = fixed_noise()
    scheduler = DPMSolverMultistepScheduler(
        **COMMON,
        algorithm_type="dpmsolver++",
        solver_order=2,
        timestep_spacing="trailing",
        final_sigmas_type="zero",
        thresholding=True,
        sample_max_value=1.0,
    )
    expected = with_scheduler(scheduler, steps, noise)
    found = sample_diffusion(
        curved_network, noise, schedule=squared_cosine(LEVELS), name="dpm_2m", steps=steps, clip=1.0
    )
    assert torch.allclose(found, expected, atol=1e-5, rtol=1e-5)


def test_one_step_of_the_second_order_solver_is_ddim():
    arguments = {"schedule": squared_cosine(LEVELS), "steps": 1, "clip": None}
    ddim, dpm = (
        sample_diffusion(curved_network, fixed_noise(), name=name, **arguments)
        for name in ("ddim", "dpm_2m")
    )
    assert torch.allclose(ddim, dpm, atol=1e-9)


def gaussian_noise_estimate(x, time):
    """Exact noise estimate of data N(MEAN, STD^2)."""
    kept = torch.tensor(squared_cosine(LEVELS).alpha_bar)[(time * LEVELS).round().long()]
    kept = kept[:, None, None]
    variance = kept * STD**2 + 1.0 - kept
    return (1.0 - kept).sqrt() * (x - kept.sqrt() * MEAN) / variance


def normal_grid(count=4001):
    """Quantiles of the standard normal: expectations without sampling error."""
    levels = (torch.arange(count, dtype=torch.float64) + 0.5) / count
    return torch.special.ndtri(levels)[:, None, None]


# Golden: methods.md annex (exact denoiser of N(.4, .3^2), trailing DDIM, squared-cosine T = 100).
@pytest.mark.parametrize(("steps", "std"), [(5, 0.183), (10, 0.236), (20, 0.266)])
def test_ddim_shrinks_the_spread_before_the_mean(steps, std):
    grid = normal_grid()
    samples = sample_diffusion(
        gaussian_noise_estimate,
        lambda _: grid,
        schedule=squared_cosine(LEVELS),
        name="ddim",
        steps=steps,
        clip=None,
    )
    assert float(samples.std()) == pytest.approx(std, abs=2e-3)
    assert float(samples.mean()) == pytest.approx(MEAN, abs=2e-3)


@pytest.mark.parametrize("name", DIFFUSION_SAMPLERS)
def test_nfe_is_counted(name):
    counted = CountedNetwork(curved_network)
    sample_diffusion(
        counted, fixed_noise(), schedule=squared_cosine(LEVELS), name=name, steps=5, clip=1.0
    )
    assert counted.nfe == 5


def test_unknown_names_are_refused():
    with pytest.raises(ConfigError, match="euler"):
        sample_diffusion(
            curved_network,
            fixed_noise(),
            schedule=squared_cosine(9),
            name="euler",
            steps=2,
            clip=None,
        )
