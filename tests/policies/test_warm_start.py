"""Warm starts: fewer steps from the previous plan; cold is the same bytes, and no row sees another.

Goldens: the point of either path, by hand from its formula.
"""

import numpy as np
import pytest
import torch

from genpolicy.candidates.answering import AnsweringPolicy
from genpolicy.errors import ConfigError
from genpolicy.policies.methods import METHODS
from genpolicy.policies.policy import load_policy
from genpolicy.policies.prefix import Prefix
from genpolicy.policies.schedules import squared_cosine, trailing_levels
from genpolicy.policies.settings import HeadConfig, SamplerConfig
from genpolicy.policies.warm_start import WarmStart, begun, skipped_steps

PATHS = ["flow", "diffusion"]


def start_of(observations, *, strength, weight=1.0):
    """Row by row in turns the left and the right mode of the toy."""
    actions = np.zeros((len(observations), 4, 2))
    actions[..., 0] = np.where(np.arange(len(observations)) % 2, 1.0, -1.0)[:, None]
    return Prefix(actions, np.full((len(observations), 4), weight), 5.0, strength)


def drawn(policy, seen, prefix, *, rows=None, candidates=2):
    rows = range(len(seen)) if rows is None else rows
    names = [("row", int(row)) for row in rows]
    return policy.sample(seen, noise_names=names, candidates=candidates, prefix=prefix)


@pytest.mark.parametrize(("strength", "steps", "skipped"), [
    (1.0, 4, 0), (0.75, 4, 1), (0.5, 4, 2), (0.51, 4, 1), (0.01, 4, 3), (0.5, 1, 0),
    (0.7, 10, 3), (0.3, 10, 7), (1.0, 16, 0),
])  # fmt: skip
def test_a_share_of_the_steps_is_rounded_up_and_never_to_none(strength, steps, skipped):
    """0.7 of 10 is 7.000000000000001 in float64 as 0.1 times 7 is: no eighth step for rounding."""
    assert skipped_steps(strength, steps) == skipped


def test_a_flow_starts_on_its_straight_line():
    noise, given = torch.full((3, 4, 2), 2.0), torch.full((3, 4, 2), -1.0)
    sampler = SamplerConfig(name="euler", steps=4)
    draw, skipped = begun(lambda _: noise, WarmStart(given, 3), sampler=sampler, head=HeadConfig())
    assert skipped == 3
    torch.testing.assert_close(draw(0), 0.75 * given + 0.25 * noise, rtol=0.0, atol=0.0)
    assert torch.equal(draw(1), noise)


def test_a_diffusion_starts_at_the_noise_of_its_level():
    noise, given = torch.full((3, 4, 2), 2.0), torch.full((3, 4, 2), -1.0)
    head = HeadConfig()
    level = trailing_levels(head.diffusion_levels, 8)[5]
    kept = float(squared_cosine(head.diffusion_levels).alpha_bar[level])
    draw, _ = begun(
        lambda _: noise, WarmStart(given, 5), sampler=SamplerConfig(name="ddim", steps=8), head=head
    )
    expected = kept**0.5 * given + (1.0 - kept) ** 0.5 * noise
    torch.testing.assert_close(draw(0), expected, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("method", PATHS)
def test_at_full_strength_it_is_the_cold_sample_byte_for_byte(folders, method, two_mode_windows):
    policy, seen = load_policy(folders[method]), two_mode_windows(6, seed=9).observations
    cold, full = (drawn(policy, seen, own) for own in (None, start_of(seen, strength=1.0)))
    assert np.array_equal(cold.actions, full.actions) and cold.nfe == full.nfe


@pytest.mark.parametrize("method", PATHS)
def test_fewer_evaluations_stay_nearer_to_the_plan(folders, method, two_mode_windows):
    policy, seen = load_policy(folders[method]), two_mode_windows(20, seed=9).observations
    away, spent = [], []
    for strength in (1.0, 0.5, 0.25):
        prefix = start_of(seen, strength=strength)
        found = drawn(policy, seen, prefix)
        away.append(np.abs(found.actions[..., 0] - prefix.actions[:, None, :, 0]).mean())
        spent.append(found.nfe)
    steps = policy.sampler.steps
    each = spent[0] // steps
    assert spent == [each * (steps - skipped_steps(own, steps)) for own in (1.0, 0.5, 0.25)]
    assert spent[0] > spent[1] and away[0] > away[1]


@pytest.mark.parametrize("method", PATHS)
def test_no_row_sees_its_company_and_one_without_a_plan_is_cold(folders, method, two_mode_windows):
    policy, seen = load_policy(folders[method]), two_mode_windows(7, seed=9).observations
    prefix = start_of(seen, strength=0.5)
    prefix.weights[::3] = 0.0
    mixed, cold = drawn(policy, seen, prefix), drawn(policy, seen, None)
    assert np.array_equal(mixed.actions[::3], cold.actions[::3])
    assert not np.isclose(mixed.actions[1], cold.actions[1]).all()
    assert mixed.nfe == cold.nfe  # the most of any row
    for row in (1, 2, 3, 5):
        own = drawn(policy, seen[row : row + 1], prefix.of([row]), rows=[row])
        assert np.array_equal(own.actions[0], mixed.actions[row])
    asked = AnsweringPolicy(policy)
    assert np.array_equal(drawn(asked, seen, prefix).actions, mixed.actions)


@pytest.mark.parametrize("method", sorted(set(METHODS) - set(PATHS)))
@pytest.mark.parametrize("strength", [0.5, 1.0])
def test_a_method_without_a_path_refuses_to_start_on_it(
    folders, method, two_mode_windows, strength
):
    policy, seen = load_policy(folders[method]), two_mode_windows(1).observations
    with pytest.raises(ConfigError, match=policy.sampler.name):
        drawn(policy, seen, start_of(seen, strength=strength))
