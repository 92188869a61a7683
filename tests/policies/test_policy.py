"""Policies: determinism, independence of the batch, counted NFE, modes, refused inputs."""

import numpy as np
import pytest
import torch

from genpolicy.errors import (
    ConfigError,
    ContractError,
    EvaluationCapError,
    IntegrityError,
    NonFiniteError,
)
from genpolicy.policies import policy as policy_module
from genpolicy.policies.call_shapes import CallShapes
from genpolicy.policies.methods import METHODS
from genpolicy.policies.policy import load_policy
from genpolicy.policies.settings import SamplerConfig
from genpolicy.policies.training import train

STEPS = {
    "bc": 1, "chunked_bc": 1, "chunked_l1": 1, "bc_noise": 1, "one_mode_bc": 1, "act": 1,
    "cvae": 1, "ibc": 8, "diffusion": 10, "flow": 8, "flow_policy": 4,
    "manicm": 2,
}  # fmt: skip
STOCHASTIC = {
    "act": ("z_prior", 1), "bc_noise": ("offset", 1), "ibc": ("derivative_free", 8),
    "diffusion": ("ddim", 10), "flow": ("euler", 8),
    "flow_policy": ("consistency", 2), "manicm": ("multistep_consistency", 2),
}  # fmt: skip
POPULATION = {"derivative_free": 32, "langevin": 32}


def sampler_of(name, steps):
    return SamplerConfig(
        name=name, steps=steps, population=POPULATION.get(name, 1),
        nfe_cap=200 if name == "bosh3" else None,
    )  # fmt: skip


def names(count):
    return [("row", index) for index in range(count)]


@pytest.mark.parametrize("method", list(METHODS))
def test_a_row_does_not_depend_on_its_company(folders, method, two_mode_windows):
    sampler = sampler_of(METHODS[method].samplers[-1], STEPS[method])
    policy = load_policy(folders[method], sampler=sampler)
    observations = two_mode_windows(40, seed=9).observations
    together = policy.sample(observations, noise_names=names(40), candidates=3)
    for row in (0, 17, 39):
        alone = policy.sample(observations[row : row + 1], noise_names=[("row", row)], candidates=3)
        assert np.array_equal(alone.actions[0], together.actions[row])
    order = np.random.default_rng(0).permutation(40)
    shuffled = policy.sample(
        observations[order], noise_names=[("row", int(row)) for row in order], candidates=3
    )
    assert np.array_equal(shuffled.actions, together.actions[order])


@pytest.mark.parametrize("method", list(STOCHASTIC))
def test_noise_is_a_function_of_its_names(folders, method, two_mode_windows):
    name, steps = STOCHASTIC[method]
    policy = load_policy(folders[method], sampler=sampler_of(name, steps))
    observations = two_mode_windows(2).observations[:1]

    def draw(noise_name):
        return policy.sample(observations, noise_names=[noise_name], candidates=2).actions

    first = draw(("a", 1))
    torch.manual_seed(0)
    np.random.seed(0)
    assert draw(("a", 1)).tobytes() == first.tobytes()
    assert draw(("a", 2)).tobytes() != first.tobytes()
    assert not np.array_equal(first[0, 0], first[0, 1])
    assert policy.stochastic


@pytest.mark.parametrize("method", list(METHODS))
def test_two_loads_give_equal_bytes(folders, method, two_mode_windows):
    observations = two_mode_windows(5).observations
    actions = [
        load_policy(folders[method]).sample(observations, noise_names=names(5), candidates=2)
        for _ in range(2)
    ]
    assert actions[0].actions.tobytes() == actions[1].actions.tobytes()


@pytest.mark.parametrize(
    ("method", "name", "steps", "nfe"),
    [
        ("bc", "direct", 1, 1), ("chunked_bc", "direct", 1, 1), ("act", "z_zero", 1, 1),
        ("act", "z_prior", 1, 1), ("diffusion", "ddim", 7, 7), ("diffusion", "ddpm", 100, 100),
        ("diffusion", "dpm_2m", 6, 6), ("diffusion", "dpm_1", 6, 6), ("diffusion", "dpm_sde", 6, 6),
        ("flow", "euler", 5, 5), ("flow", "heun", 5, 10),
        ("flow", "rk4", 3, 12), ("flow", "midpoint", 3, 6),
        ("flow_policy", "consistency", 2, 2), ("flow_policy", "consistency", 4, 4),
        ("manicm", "multistep_consistency", 1, 1), ("manicm", "multistep_consistency", 10, 10),
        ("chunked_l1", "direct", 1, 1), ("ibc", "derivative_free", 6, 7),
        ("ibc", "langevin", 9, 10),
        ("bc_noise", "offset", 1, 1),
    ],
)  # fmt: skip
def test_nfe_and_shape(folders, method, name, steps, nfe, two_mode_windows):
    policy = load_policy(folders[method], sampler=sampler_of(name, steps))
    samples = policy.sample(
        two_mode_windows(3).observations[:3], noise_names=names(3), candidates=2
    )
    assert samples.nfe == nfe
    assert samples.actions.shape == (3, 2, 1 if method == "bc" else 4, 2)
    assert samples.actions.dtype == np.float64
    assert policy.stochastic == (name not in ("direct", "z_zero"))


def test_deterministic_conventions_give_equal_candidates(folders, two_mode_windows):
    observations = two_mode_windows(2).observations[:2]
    actions = (
        load_policy(folders["act"]).sample(observations, noise_names=names(2), candidates=2).actions
    )
    assert np.array_equal(actions[:, 0], actions[:, 1])


@pytest.mark.parametrize(
    ("method", "name", "steps"),
    [("diffusion", "ddim", 101), ("diffusion", "ddim", 0), ("diffusion", "euler", 4),
     ("flow", "euler", 0), ("flow", "ddim", 4), ("bc", "direct", 2), ("ibc", "euler", 4),
     ("bc_noise", "offset", 2), ("bc_noise", "direct", 1), ("chunked_bc", "offset", 1),
     ("flow", "derivative_free", 4), ("ibc", "derivative_free", 0), ("flow", "langevin", 4),
     ("flow_policy", "consistency", 1), ("flow_policy", "consistency", 3),
     ("flow_policy", "euler", 2), ("flow", "consistency", 2),
     ("manicm", "multistep_consistency", 0), ("manicm", "multistep_consistency", 11),
     ("manicm", "ddim", 4), ("manicm", "consistency", 1),
     ("diffusion", "multistep_consistency", 1)],
)  # fmt: skip
def test_samplers_that_do_not_fit_are_refused(folders, method, name, steps):
    with pytest.raises(ConfigError, match="sampler"):
        load_policy(folders[method], sampler=sampler_of(name, steps))


@pytest.mark.parametrize(
    ("method", "name", "population"),
    [("ibc", "derivative_free", 1), ("ibc", "langevin", 1), ("flow", "euler", 2)],
)
def test_a_population_belongs_to_the_search_only(folders, method, name, population):
    with pytest.raises(ConfigError, match="population"):
        load_policy(folders[method], sampler=SamplerConfig(name=name, population=population))


def test_an_adaptive_row_takes_its_own_steps_whatever_the_others_take(folders, two_mode_windows):
    """Together they wait for the slowest; padding, of a batch of one, waits for nobody else."""
    sampler = SamplerConfig(name="bosh3", steps=4, tolerance=1e-4, nfe_cap=400)
    policy = load_policy(folders["flow"], sampler=sampler)
    observations = two_mode_windows(3, seed=9).observations
    together = policy.sample(observations, noise_names=names(3), candidates=1)
    alone = [
        policy.sample(observations[row : row + 1], noise_names=[("row", row)], candidates=1)
        for row in range(3)
    ]
    assert all(
        np.array_equal(one.actions[0], together.actions[row]) for row, one in enumerate(alone)
    )
    counts = [one.nfe for one in alone]
    assert len(set(counts)) > 1, "the rows must differ, or nothing is shown"
    assert together.nfe == max(counts)
    slow = SamplerConfig(**{**sampler.model_dump(), "nfe_cap": max(counts) - 1})
    policy = load_policy(folders["flow"], sampler=slow)
    with pytest.raises(EvaluationCapError, match=f"at most sampler.nfe_cap, {slow.nfe_cap}"):
        policy.sample(observations, noise_names=names(3), candidates=1)
    fast = counts.index(min(counts))
    again = policy.sample(observations[fast : fast + 1], noise_names=[("row", fast)], candidates=1)
    assert np.array_equal(again.actions, alone[fast].actions)


def test_padding_is_the_last_row_again(folders, two_mode_windows, monkeypatch):
    """Other noise could need more steps than any row that was asked for, or reach the cap."""
    seen, honest = [], policy_module.generate

    def spy(network, conditions, noise, **settings):
        seen.append((conditions.rows, noise(0)))
        return honest(network, conditions, noise, **settings)

    monkeypatch.setattr(policy_module, "generate", spy)
    observations = two_mode_windows(3, seed=9).observations
    policy = load_policy(folders["flow"])
    policy._calls, policy._compiled = CallShapes((16,)), None
    policy.sample(observations, noise_names=names(3), candidates=1)
    ((condition, noise),) = seen
    assert len(noise) == 16 and not torch.equal(noise[1], noise[2])
    assert torch.equal(noise[3:], noise[2:3].expand_as(noise[3:]))
    assert torch.equal(condition[3:], condition[2:3].expand_as(condition[3:]))


def test_fresh_noise_is_a_choice_of_ddim_only(folders):
    load_policy(folders["diffusion"], sampler=SamplerConfig(name="ddim", steps=4, eta=1.0))
    with pytest.raises(ConfigError, match=r"sampler\.eta of diffusion is 0.5"):
        load_policy(folders["diffusion"], sampler=SamplerConfig(name="ddpm", steps=4, eta=0.5))


@pytest.mark.parametrize(
    ("name", "steps", "cap"), [("bosh3", 1, None), ("bosh3", 6, 6), ("rk4", 2, 7)]
)
def test_a_cap_that_is_missing_or_too_low_is_refused(folders, name, steps, cap):
    with pytest.raises(ConfigError, match="nfe_cap"):
        load_policy(folders["flow"], sampler=SamplerConfig(name=name, steps=steps, nfe_cap=cap))


def test_wrong_observations_are_refused(folders, two_mode_windows):
    policy = load_policy(folders["flow"])
    good = two_mode_windows(2).observations[:1]
    for wrong in (good[:, :1], good[..., :2], good[0]):
        with pytest.raises(ContractError, match="observations"):
            policy.sample(wrong, noise_names=names(len(wrong)), candidates=1)
    with pytest.raises(NonFiniteError, match="nan"):
        policy.sample(np.where(good > 0, np.nan, good), noise_names=names(1), candidates=1)
    with pytest.raises(ContractError, match="noise name"):
        policy.sample(good, noise_names=[], candidates=1)
    with pytest.raises(ContractError, match="candidates"):
        policy.sample(good, noise_names=names(1), candidates=0)


def test_another_contract_is_refused(folders):
    load_policy(folders["flow"], action_contract_sha256="b" * 64)
    with pytest.raises(IntegrityError, match="action contract"):
        load_policy(folders["flow"], action_contract_sha256="d" * 64)


def test_identity_covers_sampler_and_weights(folders):
    own = load_policy(folders["flow"])
    other = load_policy(folders["flow"], sampler=SamplerConfig(name="euler", steps=4))
    assert own.checkpoint_hash == other.checkpoint_hash
    assert own.sampler_config_hash != other.sampler_config_hash
    assert own.checkpoint_hash != load_policy(folders["diffusion"]).checkpoint_hash


def test_generative_heads_keep_both_modes_and_the_mean_lies_between(
    tmp_path, two_mode_windows, request_for
):
    windows = two_mode_windows(1024)
    observation = np.zeros((1, 2, 3))
    for method, steps in (
        ("chunked_bc", 150), ("ibc", 600), ("diffusion", 700), ("flow", 700),
    ):  # fmt: skip
        train(tmp_path / method, request_for(method, updates=steps), windows=windows)
        policy = load_policy(tmp_path / method)
        samples = policy.sample(observation, noise_names=[("modes",)], candidates=200)
        first = samples.actions[0, :, 0, 0]
        if method == "chunked_bc":
            assert np.abs(first).max() < 0.25, "squared error must predict the mean of two modes"
        else:
            # The energy's search returns the best of its candidates, so the better mode comes
            # more often than its share.
            lowest = 0.15 if method == "ibc" else 0.3
            assert lowest < (first > 0).mean() < 1.0 - lowest
            assert (np.abs(np.abs(first) - 1.0) < 0.3).mean() > 0.9


def test_one_chunk_that_is_not_finite_is_a_candidate_like_the_others(
    folders, two_mode_windows, monkeypatch
):
    """It ended the whole batch, and with it the stage; the first layer rejects it alone."""
    policy, seen = load_policy(folders["flow"]), two_mode_windows(4).observations[:3]
    whole = policy.sample(seen, noise_names=names(3), candidates=2)
    assert whole.finite() is whole
    honest = policy_module.generate

    def spoiled(network, conditions, noise, **rest):
        chunks, nfe = honest(network, conditions, noise, **rest)
        chunks[3, 0, 0] = np.nan
        return chunks, nfe

    monkeypatch.setattr(policy_module, "generate", spoiled)
    drawn = policy.sample(seen, noise_names=names(3), candidates=2)
    assert np.argwhere(~np.isfinite(drawn.actions)).tolist() == [[1, 1, 0, 0]]
    kept = np.isfinite(drawn.actions)
    assert np.array_equal(drawn.actions[kept], whole.actions[kept])
    with pytest.raises(NonFiniteError, match=r"sampled chunks, \[1, 1, 0, 0\] is nan"):
        drawn.finite()
