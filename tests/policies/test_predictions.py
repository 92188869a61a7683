"""Predictions: there and back, gains that are exact for a Gaussian, training of each kind."""

import numpy as np
import pytest
import torch

from genpolicy.policies.checkpoint import load_checkpoint
from genpolicy.policies.objectives import Batch, Denoising
from genpolicy.policies.policy import load_policy
from genpolicy.policies.predictions import PREDICTIONS
from genpolicy.policies.schedules import squared_cosine
from genpolicy.policies.settings import HeadConfig
from genpolicy.policies.training import train

SCHEDULE = squared_cosine(100)


@pytest.mark.parametrize("name", list(PREDICTIONS))
def test_the_clean_chunk_comes_back_from_the_target(name):
    generator = torch.Generator().manual_seed(3)
    clean, noise = (
        torch.randn(5, 4, 2, generator=generator, dtype=torch.float64) for _ in range(2)
    )
    for level in (0, 30, 99):
        noisy = SCHEDULE.add_noise(clean, noise, torch.full((5,), level))
        kept = float(SCHEDULE.alpha_bar[level])
        share = torch.full((5, 1, 1), kept, dtype=torch.float64)
        target = PREDICTIONS[name].target(clean, noise, share)
        assert torch.allclose(PREDICTIONS[name].clean(noisy, target, kept), clean, atol=1e-6)


@pytest.mark.parametrize("name", list(PREDICTIONS))
@pytest.mark.parametrize("std", [0.05, 0.2, 1.0])
def test_gains_are_the_best_linear_estimate_and_leave_its_variance(name, std):
    """By regression of the target on the noisy number: slope, and what it leaves."""
    level = torch.arange(0, 100, 9)
    time = SCHEDULE.level_time(level.to(torch.float64))
    gains = PREDICTIONS[name].gains(SCHEDULE, time, data_std=std)
    # exact second moments from two orthogonal unit directions: clean and noise
    clean, noise = (torch.tensor(v, dtype=torch.float64) for v in ([std, 0.0], [0.0, 1.0]))
    for row in range(len(level)):
        kept = SCHEDULE.kept(time)[row]
        x = kept.sqrt() * clean + (1.0 - kept).sqrt() * noise
        target = PREDICTIONS[name].target(clean, noise, kept)
        slope = (target @ x) / (x @ x)
        left = (target - slope * x).norm()
        assert float(gains.skip[row]) == pytest.approx(float(slope))
        assert float(gains.outer[row]) == pytest.approx(float(left), abs=1e-9)
        assert float(gains.inner[row] * x.norm()) == pytest.approx(1.0)


def test_the_default_trains_on_the_noise_alone(folders, two_mode_windows):
    """Golden: the loss as it stood before there were several predictions, to the bit."""
    network = load_checkpoint(folders["diffusion"]).network
    windows = two_mode_windows(64)
    batch = Batch(
        torch.tensor(windows.observations, dtype=torch.float32),
        torch.tensor(windows.actions, dtype=torch.float32),
        torch.ones(64, 4, 1),
    )
    objective = Denoising(network.dimensions, None, HeadConfig())
    generator = torch.Generator().manual_seed(5)
    level = torch.randint(100, (64,), generator=generator)
    noise = torch.randn(batch.actions.shape, generator=generator)
    time = level.to(torch.float32) / 100
    noisy = SCHEDULE.add_noise(batch.actions, noise, level)
    predicted = network.evaluate(network.encode(batch.observations), noisy, time)
    expected = (predicted - noise).square().sum() / predicted.numel()
    found = objective.loss(network, batch, torch.Generator().manual_seed(5))
    assert torch.equal(found, expected)


@pytest.mark.parametrize("name", ["v", "x0"])
def test_each_kind_learns_both_modes(tmp_path, two_mode_windows, request_for, name):
    head = HeadConfig(latent_dim=4, posterior_width=16, prediction=name)
    request = request_for("diffusion", updates=500, head=head)
    train(tmp_path / name, request, windows=two_mode_windows(1024))
    policy = load_policy(tmp_path / name)
    samples = policy.sample(np.zeros((1, 2, 3)), noise_names=[("modes",)], candidates=200)
    first = samples.actions[0, :, 0, 0]
    assert 0.3 < (first > 0).mean() < 0.7
    assert (np.abs(np.abs(first) - 1.0) < 0.3).mean() > 0.8
