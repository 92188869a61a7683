"""Validation while training: measured again with nothing learned it is the same, to the bit."""

import dataclasses

import numpy as np
import pytest
import torch

from genpolicy.errors import ContractError
from genpolicy.policies.checkpoint import load_checkpoint
from genpolicy.policies.methods import METHODS, method_named
from genpolicy.policies.settings import TrainingConfig
from genpolicy.policies.validation import EPISODE_WINDOWS, Validation, moments
from genpolicy.policies.validation_row import three_quarters
from genpolicy.policies.windows import as_batch

NAMES = np.repeat(["long", "short", "one"], [460, 51, 1])


@pytest.mark.parametrize("method", ["chunked_bc", "act", "diffusion", "flow"])
def test_windows_and_noise_are_fixed_and_the_random_state_is_not_touched(
    method, folders, two_mode_windows
):
    checkpoint = load_checkpoint(folders[method])
    config = checkpoint.config
    assert method in METHODS
    torch.manual_seed(0)
    objective = method_named(method).objective(config.dimensions, config.network, config.head)
    windows = as_batch(
        two_mode_windows().shortened(config.horizons), checkpoint.normalisation,
        mask_padding=True, device="cpu",
    )  # fmt: skip
    followed = Validation(windows, NAMES, seed=5, device="cpu")
    before = torch.get_rng_state()
    for count in (1, 2):
        followed.follow(count, checkpoint.network, objective)
    assert torch.equal(before, torch.get_rng_state())
    first, second = followed.rows[:3], followed.rows[3:]
    assert [dataclasses.replace(row, updates=2) for row in first] == second
    assert [(row.episode_uuid, row.windows) for row in first] == [
        ("long", EPISODE_WINDOWS), ("short", EPISODE_WINDOWS), ("one", 1),
    ]  # fmt: skip
    assert len({row.loss for row in first}) == 3
    assert followed.loss(checkpoint.network, objective) > 0
    assert not Validation(windows, None, seed=5, device="cpu").rows


def test_the_network_is_kept_as_it_was_where_it_is_asked_for(folders, two_mode_windows):
    checkpoint = load_checkpoint(folders["flow"])
    config, network = checkpoint.config, checkpoint.network
    objective = method_named("flow").objective(config.dimensions, config.network, config.head)
    windows = as_batch(
        two_mode_windows(), checkpoint.normalisation, mask_padding=True, device="cpu"
    )
    followed = Validation(windows, None, seed=5, device="cpu", keep_after=2)
    weight = next(network.parameters())
    for count in (1, 2, 3):
        with torch.no_grad():
            weight.fill_(float(count))
        followed.follow(count, network, objective)
        assert (followed.earlier is None) == (count < 2)
    assert bool((next(followed.earlier.parameters()) == 2.0).all())


@pytest.mark.parametrize(
    ("updates", "every", "expected"),
    [
        (4000, 1000, {1000, 2000, 3000, 4000}),
        (1200, 600, {600, 900, 1200}),
        (30, 10, {10, 20, 23, 30}),
        (1, 5, {1}),
    ],
)
def test_three_quarters_and_the_end_are_always_measured(updates, every, expected):
    config = TrainingConfig(updates=updates, validation_every=every)
    assert moments(config) == expected
    assert three_quarters(updates) in expected


def test_an_episode_for_each_window_or_none(two_mode_windows):
    windows = two_mode_windows()
    with pytest.raises(ContractError, match="an episode for each"):
        dataclasses.replace(windows, episodes=NAMES[1:])
    kept = dataclasses.replace(windows, episodes=NAMES)
    assert kept.episodes is NAMES
