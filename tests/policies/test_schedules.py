"""Schedules of noise and of straight paths, against diffusers and known answers."""

import math

import numpy as np
import pytest
import torch
from diffusers import DDPMScheduler

from genpolicy.errors import ConfigError
from genpolicy.policies.ode_samplers import sample_ode
from genpolicy.policies.schedules import (
    flow_gains,
    noise_gains,
    squared_cosine,
    straight_path,
    trailing_levels,
)

LEVELS = 100


COMMON = {"num_train_timesteps": LEVELS, "beta_schedule": "squaredcos_cap_v2"}


def test_schedule_equals_diffusers():
    reference = DDPMScheduler(**COMMON).alphas_cumprod.double().numpy()
    np.testing.assert_allclose(squared_cosine(LEVELS).alpha_bar, reference, rtol=1e-4)


@pytest.mark.parametrize("std", [0.05, 0.3, 1.0])
def test_gains_alone_are_the_exact_answer_for_a_centred_gaussian(std):
    x = torch.linspace(-2.0, 2.0, 10, dtype=torch.float64)[:, None, None]
    time = torch.arange(10, dtype=torch.float64) * 11 / LEVELS
    kept = torch.tensor(squared_cosine(LEVELS).alpha_bar)[(time * LEVELS).round().long()]
    noise = (1.0 - kept).sqrt() / (kept * std**2 + 1.0 - kept) * x.flatten()
    found = noise_gains(squared_cosine(LEVELS), time, data_std=std)
    assert torch.allclose(found.skip * x.flatten(), noise)
    velocity = (time * std**2 - (1.0 - time)) / ((time * std) ** 2 + (1.0 - time) ** 2)
    gains = flow_gains(time, data_std=std)
    assert torch.allclose(gains.skip, velocity)
    # what is left for the network has the variance outer^2: law of total variance
    left = 1.0 + std**2 - velocity**2 * ((time * std) ** 2 + (1.0 - time) ** 2)
    assert torch.allclose(gains.outer**2, left)


def test_flow_time_is_zero_at_noise_and_one_at_the_action():
    noise, action = torch.randn(2, 3, 2), torch.randn(2, 3, 2)
    start, velocity = straight_path(noise, action, torch.zeros(2))
    end, _ = straight_path(noise, action, torch.ones(2))
    assert torch.equal(start, noise)
    assert torch.equal(end, action)
    assert torch.equal(velocity, action - noise)
    found = sample_ode(lambda x, t: velocity, lambda _: noise, name="euler", steps=1)
    assert torch.allclose(found, action)


@pytest.mark.parametrize("steps", [0, -1, LEVELS + 1])
def test_steps_outside_the_training_levels_are_refused(steps):
    with pytest.raises(ConfigError, match="sampler_steps"):
        trailing_levels(LEVELS, steps)


def test_trailing_levels_start_at_pure_noise():
    for steps in range(1, LEVELS + 1):
        levels = trailing_levels(LEVELS, steps)
        assert levels[0] == LEVELS - 1
        assert len(set(levels)) == steps
        assert min(levels) >= 0


def test_half_the_levels_hold_half_the_signal():
    # cos^2 at its middle, with the offset of 0.008: golden from the formula
    middle = (
        math.cos((0.5 + 0.008) / 1.008 * math.pi / 2) ** 2
        / math.cos(0.008 / 1.008 * math.pi / 2) ** 2
    )
    assert squared_cosine(LEVELS).alpha_bar[49] == pytest.approx(middle, rel=1e-9)
