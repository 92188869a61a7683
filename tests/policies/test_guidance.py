"""Guided drawing: chunks go on from what is given; the gradient is the one of the formula."""

import math

import numpy as np
import pytest
import torch

from genpolicy.errors import ConfigError, EvaluationCapError
from genpolicy.policies.diffusion_samplers import DIFFUSION_SAMPLERS, sample_diffusion
from genpolicy.policies.guidance import GUIDED, Guidance, GuidedNetwork, path_of
from genpolicy.policies.methods import METHODS
from genpolicy.policies.ode_samplers import FIXED_TABLEAUS, sample_ode
from genpolicy.policies.policy import load_policy
from genpolicy.policies.prefix import Prefix
from genpolicy.policies.samplers import CountedNetwork
from genpolicy.policies.schedules import squared_cosine
from genpolicy.policies.settings import HeadConfig, SamplerConfig

BOUND = 5.0
COVARIANCE = torch.tensor(
    [[1.0, 0.9, 0.6], [0.9, 1.0, 0.9], [0.6, 0.9, 1.0]], dtype=torch.float64
) * 0.09  # fmt: skip
"""Of three actions of one number, strongly tied from row to row."""


def posterior(x, a, s):
    """Exact clean estimate of x = a clean + s noise, clean ~ N(0, COVARIANCE). (B, 3, 1)."""
    gain = a * COVARIANCE @ torch.linalg.inv(a**2 * COVARIANCE + s**2 * torch.eye(3).double())
    return torch.einsum("kl,bld->bkd", gain, x)


def flow_network(x, time):
    t = float(time[0])
    return (posterior(x, t, 1.0 - t) - x) / max(1.0 - t, 1e-12)


def diffusion_network(schedule, prediction):
    def network(x, time):
        kept = float(schedule.kept(time)[0])
        a, s = math.sqrt(kept), math.sqrt(1.0 - kept)
        clean = posterior(x, a, s)
        noise = (x - a * clean) / s
        return {"noise": noise, "v": a * noise - s * clean, "x0": clean}[prediction]

    return network


def noise(count=64):
    drawn = torch.randn(
        (count, 3, 1), generator=torch.Generator().manual_seed(3), dtype=torch.float64
    )
    return lambda _: drawn


def guidance(count=64, *, given=0.5, weight=1.0):
    """The first action is given."""
    weights = torch.zeros((count, 3, 1), dtype=torch.float64)
    weights[:, 0] = weight
    return Guidance(torch.full((count, 3, 1), given, dtype=torch.float64), weights, BOUND)


def drawn(kind, *, to, prediction="noise", steps=32):
    """Chunks, and the counted evaluations."""
    head = HeadConfig(prediction=prediction)
    if kind == "flow":
        sampler, counted = SamplerConfig(name="euler", steps=steps), CountedNetwork(flow_network)
    else:
        sampler = SamplerConfig(name="ddim", steps=steps, clip=None)
        schedule = squared_cosine(head.diffusion_levels)
        counted = CountedNetwork(diffusion_network(schedule, prediction))
    network = counted if to is None else GuidedNetwork(counted, path_of(sampler, head), to)
    if kind == "flow":
        chunks = sample_ode(network, noise(), name="euler", steps=steps)
    else:
        chunks = sample_diffusion(
            network, noise(), schedule=squared_cosine(head.diffusion_levels), sampler=sampler,
            prediction=prediction,
        )  # fmt: skip
    return chunks[..., 0].numpy(), counted.nfe


CASES = [("flow", "noise"), *(("diffusion", name) for name in ("noise", "v", "x0"))]


@pytest.mark.parametrize(("kind", "prediction"), CASES)
def test_the_given_row_is_kept_and_the_free_ones_follow_it(kind, prediction):
    free, plain = drawn(kind, to=None, prediction=prediction)
    pulled, spent = drawn(kind, to=guidance(), prediction=prediction)
    assert (plain, spent) == (32, 64)  # a backward pass for each evaluation
    before, after = np.abs(free[:, 0] - 0.5).mean(), np.abs(pulled[:, 0] - 0.5).mean()
    assert before > 0.4 and after < 0.5 * before
    # Rows that nobody gave move along, the nearer the more: nothing is cut after the first.
    moved = pulled.mean(axis=0) - free.mean(axis=0)
    assert 0.6 * moved[0] < moved[1] < moved[0] and 0.1 * moved[0] < moved[2] < 0.5 * moved[0]
    assert np.abs(pulled[:, 1] - pulled[:, 0]).mean() < 1.5 * np.abs(free[:, 1] - free[:, 0]).mean()


def test_flow_and_diffusion_are_pulled_as_far():
    """One formula for any path: the same data, the same pull, up to the solvers' errors."""
    moved = []
    for kind in ("flow", "diffusion"):
        free, pulled = (drawn(kind, to=to, steps=64)[0].mean(axis=0) for to in (None, guidance()))
        moved.append(pulled - free)
    np.testing.assert_allclose(*moved, atol=0.02)


def test_every_prediction_of_one_diffusion_is_guided_alike():
    first, *others = (
        drawn("diffusion", to=guidance(), prediction=name)[0] for name in ("noise", "v", "x0")
    )
    for other in others:
        np.testing.assert_allclose(other, first, atol=1e-9)


def test_the_pull_is_the_one_of_the_formula():
    """Flow at one time, by finite differences: v + min(bound, ...) J^T w (given - clean)."""
    t = 0.4
    x, time, to = noise(2)(0), torch.full((2,), t, dtype=torch.float64), guidance(2, given=0.3)
    to.weights[:, 1] = 0.25
    counted = CountedNetwork(flow_network)
    guided = GuidedNetwork(counted, path_of(SamplerConfig(name="euler"), HeadConfig()), to)(x, time)

    def clean(point):
        return point + (1.0 - t) * flow_network(point, time)

    error = to.weights * (to.given - clean(x))
    pull, step = torch.zeros_like(x), 1e-6
    for row in range(3):
        moved = x.clone()
        moved[:, row] += step
        pull[:, row] = (((clean(moved) - clean(x)) / step) * error).sum(dim=1)
    factor = min(BOUND, ((1 - t) ** 2 + t**2) / (t * (1 - t)))
    np.testing.assert_allclose(guided, flow_network(x, time) + factor * pull, atol=1e-7)


@pytest.mark.parametrize("at", [0.0, 1.0])
def test_at_either_end_the_bound_holds_and_nothing_is_infinite(at):
    network = CountedNetwork(lambda x, _: torch.tanh(x))
    x, time = noise(4)(0), torch.full((4,), at, dtype=torch.float64)
    to = guidance(4, given=0.3)
    guided = GuidedNetwork(network, path_of(SamplerConfig(name="heun"), HeadConfig()), to)(x, time)
    assert torch.isfinite(guided).all()
    away = (guided - torch.tanh(x))[:, 0].abs()
    assert (away <= BOUND * 2.0 * (0.3 - x - torch.tanh(x))[:, 0].abs() + 1e-9).all()


def test_a_sampler_without_a_path_is_refused_by_name():
    for name in ("direct", "bosh3", "consistency", "derivative_free"):
        with pytest.raises(ConfigError, match=name):
            path_of(SamplerConfig(name=name), HeadConfig())
    assert set(GUIDED) == {*DIFFUSION_SAMPLERS, *FIXED_TABLEAUS}


def test_backward_passes_count_against_the_cap():
    counted = CountedNetwork(flow_network, cap=3)
    guided = GuidedNetwork(counted, path_of(SamplerConfig(name="euler"), HeadConfig()), guidance())
    with pytest.raises(EvaluationCapError):
        sample_ode(guided, noise(), name="euler", steps=2)
    assert counted.nfe == 3


# -- of a policy ----------------------------------------------------------------------------------


def prefix_of(observations, *, weight=1.0):
    actions = np.zeros((len(observations), 4, 2))
    actions[:, 0, 0] = np.where(np.arange(len(observations)) % 2, 1.0, -1.0)
    weights = np.zeros((len(observations), 4))
    weights[:, 0] = weight
    return Prefix(actions, weights, BOUND)


def names(rows):
    return [("row", int(row)) for row in rows]


@pytest.mark.parametrize("method", ["flow", "diffusion"])
def test_a_prefix_chooses_the_mode_and_no_row_sees_its_company(folders, method, two_mode_windows):
    policy = load_policy(folders[method])
    seen = two_mode_windows(20, seed=9).observations
    plain = policy.sample(seen, noise_names=names(range(20)), candidates=2)
    prefix = prefix_of(seen)
    guided = policy.sample(seen, noise_names=names(range(20)), candidates=2, prefix=prefix)
    assert guided.nfe == 2 * plain.nfe
    before = np.abs(plain.actions[:, :, 0, 0] - prefix.actions[:, None, 0, 0]).mean()
    after = np.abs(guided.actions[:, :, 0, 0] - prefix.actions[:, None, 0, 0]).mean()
    assert after < 0.5 * before
    for row in (0, 7, 19):
        alone = policy.sample(
            seen[row : row + 1], noise_names=names([row]), candidates=2,
            prefix=Prefix(prefix.actions[row : row + 1], prefix.weights[row : row + 1], BOUND),
        )  # fmt: skip
        assert np.array_equal(alone.actions[0], guided.actions[row])
    again = policy.sample(seen, noise_names=names(range(20)), candidates=2)
    assert np.array_equal(again.actions, plain.actions)


@pytest.mark.parametrize("method", ["flow", "diffusion"])
def test_a_row_without_a_weight_is_the_plain_one_bit_for_bit(folders, method, two_mode_windows):
    policy = load_policy(folders[method])
    seen = two_mode_windows(6, seed=9).observations
    prefix = prefix_of(seen)
    prefix.weights[::2] = 0.0
    plain, guided = (
        policy.sample(seen, noise_names=names(range(6)), candidates=3, prefix=given).actions
        for given in (None, prefix)
    )
    assert np.array_equal(guided[::2], plain[::2])
    assert not np.isclose(guided[1::2], plain[1::2]).all(axis=(1, 2, 3)).any()


@pytest.mark.parametrize("method", sorted(set(METHODS) - {"flow", "diffusion"}))
def test_a_method_without_a_path_refuses_a_prefix(folders, method, two_mode_windows):
    policy = load_policy(folders[method])
    seen = two_mode_windows(1).observations
    assert not policy.guided
    with pytest.raises(ConfigError, match=policy.sampler.name):
        policy.sample(seen, noise_names=names([0]), candidates=1, prefix=prefix_of(seen))
