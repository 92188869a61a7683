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
from genpolicy.policies.settings import SamplerConfig

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
        network,
        noise,
        schedule=squared_cosine(LEVELS),
        sampler=SamplerConfig(name="ddim", steps=steps, clip=clip),
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
        curved_network,
        noise,
        schedule=squared_cosine(LEVELS),
        sampler=SamplerConfig(name="ddpm", steps=steps),
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
        curved_network,
        noise,
        schedule=squared_cosine(LEVELS),
        sampler=SamplerConfig(name="dpm_2m", steps=steps),
    )
    assert torch.allclose(found, expected, atol=1e-5, rtol=1e-5)


def drawn(name, *, steps, network=curved_network, clip=1.0, eta=0.0, **settings):
    sampler = SamplerConfig(name=name, steps=steps, clip=clip, eta=eta)
    return sample_diffusion(
        network, fixed_noise(), schedule=squared_cosine(LEVELS), sampler=sampler, **settings
    )


@pytest.mark.parametrize("steps", [5, 10, 20])
def test_the_stochastic_solver_equals_diffusers(steps, monkeypatch):
    noise = fixed_noise()
    scheduler = DPMSolverMultistepScheduler(
        **COMMON,
        algorithm_type="sde-dpmsolver++",
        solver_order=2,
        timestep_spacing="trailing",
        final_sigmas_type="zero",
        thresholding=True,
        sample_max_value=1.0,
    )
    calls = iter(range(1, LEVELS + 1))
    monkeypatch.setattr(
        "diffusers.schedulers.scheduling_dpmsolver_multistep.randn_tensor",
        lambda *_, **__: noise(next(calls)),
    )
    expected = with_scheduler(scheduler, steps, noise)
    assert torch.allclose(drawn("dpm_sde", steps=steps), expected, atol=1e-5, rtol=1e-5)


@pytest.mark.parametrize("steps", [1, 5, 16, LEVELS])
@pytest.mark.parametrize("clip", [None, 1.0])
def test_the_first_order_solver_is_ddim(steps, clip):
    network = gaussian_noise_estimate if clip is None else curved_network
    one, other = (
        drawn(name, steps=steps, clip=clip, network=network) for name in ("ddim", "dpm_1")
    )
    assert float((one - other).abs().max()) < 1e-12


def test_one_step_of_the_second_order_solvers_is_ddim():
    for name in ("dpm_2m", "dpm_sde"):
        one, other = (drawn(each, steps=1, clip=None) for each in ("ddim", name))
        assert torch.allclose(one, other, atol=1e-9)
        assert not torch.allclose(drawn("ddim", steps=5), drawn(name, steps=5), atol=1e-3)


@pytest.mark.parametrize("steps", [4, 16, LEVELS])
def test_ddim_with_all_of_the_noise_is_ddpm(steps):
    one, other = drawn("ddim", steps=steps, eta=1.0), drawn("ddpm", steps=steps)
    assert float((one - other).abs().max()) < 1e-9
    half = drawn("ddim", steps=steps, eta=0.5)
    for end in (one, drawn("ddim", steps=steps)):
        assert not torch.allclose(half, end, atol=1e-3)


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
        sampler=SamplerConfig(name="ddim", steps=steps, clip=None),
    )
    assert float(samples.std()) == pytest.approx(std, abs=2e-3)
    assert float(samples.mean()) == pytest.approx(MEAN, abs=2e-3)


def moments(name, steps, *, eta=0.0):
    """Mean and deviation of an affine sampler, without sampling error.

    With the exact estimate of a Gaussian each update is affine in the noise of every step, so
    that unit noise in one step at a time says how much of it is left at the end.
    """
    rows = steps + 1

    def noise(step):
        unit = torch.zeros(rows, 1, 1, dtype=torch.float64)
        unit[step] = 1.0
        return unit

    base, *moved = sample_diffusion(
        gaussian_noise_estimate,
        lambda step: torch.cat([torch.zeros(1, 1, 1, dtype=torch.float64), noise(step)]),
        schedule=squared_cosine(LEVELS),
        sampler=SamplerConfig(name=name, steps=steps, clip=None, eta=eta),
    ).flatten()
    return float(base), float(sum((value - base) ** 2 for value in moved) ** 0.5)


@pytest.mark.parametrize(
    ("name", "eta", "error"),
    [("ddim", 0.0, 0.008), ("ddim", 1.0, 0.017), ("ddpm", 0.0, 0.017), ("dpm_1", 0.0, 0.008),
     ("dpm_2m", 0.0, 0.0005), ("dpm_sde", 0.0, 0.004)],
)  # fmt: skip
def test_every_sampler_converges_to_the_gaussian(name, eta, error):
    """The mean at once, the spread from below; second order comes ten times nearer."""
    for steps, least, most in ((5, 0.1, 0.13), (LEVELS, 0.0, error)):
        mean, std = moments(name, steps, eta=eta)
        assert abs(mean - MEAN) < 5e-4
        assert least <= abs(std - STD) <= most


def test_the_stochastic_solver_converges_with_the_levels(monkeypatch):
    """What is left at 100 levels is the length of the steps, not a wrong variance."""
    coarse = abs(moments("dpm_sde", LEVELS)[1] - STD)
    monkeypatch.setitem(globals(), "LEVELS", 1000)
    fine = abs(moments("dpm_sde", 1000)[1] - STD)
    assert fine < 0.0003 < 0.002 < coarse


@pytest.mark.parametrize("name", DIFFUSION_SAMPLERS)
@pytest.mark.parametrize("prediction", ["v", "x0"])
def test_what_is_predicted_does_not_change_the_sample(name, prediction):
    """The same knowledge said as noise, v or the clean chunk."""

    def other(x, time):
        noise = gaussian_noise_estimate(x, time)
        kept = squared_cosine(LEVELS).kept(time)[:, None, None].to(x.dtype)
        clean = (x - (1.0 - kept).sqrt() * noise) / kept.sqrt()
        return clean if prediction == "x0" else kept.sqrt() * noise - (1.0 - kept).sqrt() * clean

    expected = drawn(name, steps=12, network=gaussian_noise_estimate)
    found = drawn(name, steps=12, network=other, prediction=prediction)
    assert torch.allclose(found, expected, atol=1e-9)
    wrong = drawn(name, steps=12, network=other)
    assert not torch.allclose(wrong, expected, atol=1e-2)


@pytest.mark.parametrize("name", DIFFUSION_SAMPLERS)
def test_nfe_is_counted(name):
    counted = CountedNetwork(curved_network)
    drawn(name, steps=5, network=counted)
    assert counted.nfe == 5


def test_another_sampler_is_refused():
    with pytest.raises(ConfigError, match="euler"):
        drawn("euler", steps=2)
