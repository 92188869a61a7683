"""The energy head: its code, its negatives, its search; mathematics against known answers."""

import math

import pytest
import torch

from genpolicy.errors import ConfigError, ContractError
from genpolicy.policies.checkpoint import load_checkpoint
from genpolicy.policies.energy import (
    CODE_BOUND,
    NEGATIVE_SCALES,
    ChunkCode,
    EnergyContrast,
    EnergyNetwork,
)
from genpolicy.policies.networks import Dimensions
from genpolicy.policies.objectives import Batch
from genpolicy.policies.policy import NetworkPolicy
from genpolicy.policies.settings import HeadConfig, NetworkConfig, SamplerConfig

SIZES = Dimensions(observation_horizon=2, observation_dim=3, prediction_horizon=4, action_dim=2)


NETWORK = NetworkConfig(
    encoder_width=16, condition_dim=16, trunk_width=48, trunk_blocks=1, time_features=16,
    head_parameters=6000,
)  # fmt: skip


def chunks_of_rank(rank, count=300, seed=0):
    """Chunks that vary along `rank` directions only, around a mean that is not zero."""
    generator = torch.Generator().manual_seed(seed)
    directions = torch.randn(rank, 8, generator=generator)
    return (torch.randn(count, rank, generator=generator) @ directions + 0.7).reshape(count, 4, 2)


def test_a_code_as_long_as_the_data_varies_loses_nothing():
    chunks = chunks_of_rank(3)
    code = ChunkCode(SIZES, 3)
    code.fit(chunks)
    codes = code.encode(chunks)
    torch.testing.assert_close(code.decode(codes), chunks, atol=1e-5, rtol=0)
    torch.testing.assert_close(codes.amax(0), torch.ones(3), atol=1e-5, rtol=0)
    torch.testing.assert_close(codes.amin(0), -torch.ones(3), atol=1e-5, rtol=0)


def test_the_code_does_not_depend_on_the_order_of_the_data():
    chunks = chunks_of_rank(5)
    one, two = ChunkCode(SIZES, 4), ChunkCode(SIZES, 4)
    one.fit(chunks)
    two.fit(chunks.flip(0))
    torch.testing.assert_close(one.encode(chunks), two.encode(chunks), atol=1e-5, rtol=0)


def test_an_axis_points_where_its_largest_entry_is_positive():
    """The sign of an eigenvector is the library's whim; the code's must not be."""
    for seed in range(5):
        code = ChunkCode(SIZES, 4)
        code.fit(chunks_of_rank(5, seed=seed))
        largest = code.axes.gather(0, code.axes.abs().argmax(dim=0, keepdim=True))
        assert bool((largest > 0).all())


def test_a_constant_number_gives_a_finite_code():
    chunks = torch.zeros(10, 4, 2)
    code = ChunkCode(SIZES, 4)
    code.fit(chunks)
    assert torch.isfinite(code.encode(chunks)).all()
    torch.testing.assert_close(code.decode(torch.ones(2, 4)), chunks[:2], atol=1e-5, rtol=0)


def test_axes_without_variation_are_left_out():
    """Rounding along them, blown up to [-1, 1], would drown the axes that matter."""
    chunks = chunks_of_rank(2) + 1e-6 * torch.randn(300, 4, 2, generator=torch.Generator())
    network = EnergyNetwork(SIZES, NETWORK, HeadConfig(code_dim=5))
    network.code.fit(chunks)
    assert network.code.used.tolist() == [1.0, 1.0, 0.0, 0.0, 0.0]
    assert float(network.code.encode(chunks)[:, 2:].abs().max()) == 0.0
    candidates = torch.rand(1, 6, 5)
    moved = candidates + torch.tensor([0.0, 0.0, 0.7, -0.3, 0.5])
    condition = torch.randn(1, 16)
    assert torch.equal(network.evaluate(condition, candidates), network.evaluate(condition, moved))


def test_the_code_travels_with_the_checkpoint(folders):
    network = load_checkpoint(folders["ibc"]).network
    assert isinstance(network, EnergyNetwork)
    assert float(network.code.axes.abs().sum()) > 0.0
    torch.testing.assert_close(network.code.axes.T @ network.code.axes, torch.eye(8))


def test_the_loss_of_an_indifferent_energy_is_the_logarithm_of_the_choices():
    """Golden: with equal scores the truth is one of N + 1, whatever the weights."""
    network = EnergyNetwork(SIZES, NETWORK, HeadConfig(code_dim=4))
    objective = EnergyContrast(SIZES, NETWORK, HeadConfig(code_dim=4, energy_negatives=7))
    for part in (network.head.direct, network.head.branch_out):
        for parameter in part.parameters():
            torch.nn.init.zeros_(parameter)
    actions = chunks_of_rank(4, 32)
    batch = Batch(torch.zeros(32, 2, 3), actions, torch.ones(32, 4, 1))
    objective.prepare(network, batch)
    loss = objective.loss(network, batch, torch.Generator().manual_seed(0))
    assert float(loss.detach()) == pytest.approx(math.log(8.0), rel=1e-6)


def test_truth_and_its_close_negatives_are_exchangeable(monkeypatch):
    """Nothing but the data tells the truth from its negatives: no place in the cloud is its own."""
    monkeypatch.setattr("genpolicy.policies.energy.NEGATIVE_SCALES", (0.25,))
    objective = EnergyContrast(SIZES, NETWORK, HeadConfig(energy_negatives=3))
    truth = torch.full((40_000, 1, 1), 30.0)  # far outside of the box: uniform rows are far away
    negatives = objective.negatives(truth, torch.Generator().manual_seed(0))
    cloud = torch.cat([truth, negatives], dim=1)[..., 0]
    cloud = cloud[((cloud - 30.0).abs() < 5.0).all(dim=1) & (cloud[:, 1] != 30.0)]
    assert len(cloud) > 5_000
    others = (cloud.sum(1, keepdim=True) - cloud) / 3.0
    distance = (cloud - others).abs().mean(dim=0)
    assert float(distance[0]) == pytest.approx(float(distance[1:].mean()), rel=0.03)
    # Around the truth itself, without a centre of their own, negatives would give it away.
    naive = 30.0 + 0.25 * torch.randn(len(cloud), 3, generator=torch.Generator().manual_seed(1))
    cloud = torch.cat([cloud[:, :1], naive], dim=1)
    others = (cloud.sum(1, keepdim=True) - cloud) / 3.0
    distance = (cloud - others).abs().mean(dim=0)
    assert float(distance[0]) < 0.8 * float(distance[1:].mean())


def test_negatives_differ_along_random_axes_by_every_scale():
    objective = EnergyContrast(SIZES, NETWORK, HeadConfig(energy_negatives=64))
    truth = torch.full((4000, 1, 6), 0.9)
    negatives = objective.negatives(truth, torch.Generator().manual_seed(1))
    moved = (negatives != truth).any(dim=1)
    counts = torch.bincount(moved.sum(dim=1), minlength=7)
    assert bool((counts > 200).all()), "from no axis to all of them"
    assert bool((((negatives != truth).all(dim=1)) == moved).all()), "one subset for a row"
    width = negatives.std(dim=1)
    for scale in NEGATIVE_SCALES:
        assert int(((width - scale).abs() < 0.2 * scale).sum()) > 500
    uniform = (width - CODE_BOUND / 3**0.5).abs() < 0.07
    assert 0.05 < float(uniform.float().mean()) < 0.1


def test_an_energy_without_candidates_is_refused():
    network = EnergyNetwork(SIZES, NETWORK, HeadConfig(code_dim=4))
    with pytest.raises(ContractError, match="candidates"):
        network.evaluate(torch.zeros(1, 16))
    with pytest.raises(ConfigError, match="head_parameters"):
        EnergyNetwork(SIZES, NETWORK.model_copy(update={"head_parameters": 500}), HeadConfig())


def test_more_candidates_score_better(folders, two_mode_windows):
    """The search is a search: its scores rise with the population."""
    checkpoint = load_checkpoint(folders["ibc"])
    observations = two_mode_windows(20, seed=5).observations
    scores = []
    for population in (2, 256):
        sampler = SamplerConfig(name="derivative_free", steps=8, population=population)
        policy = NetworkPolicy(checkpoint, sampler=sampler)
        drawn = policy.sample(
            observations, noise_names=[("x", i) for i in range(20)], candidates=1
        ).actions[:, 0]
        network = checkpoint.network
        assert isinstance(network, EnergyNetwork)
        normal = checkpoint.normalisation.action.normalise(drawn)
        codes = network.code.encode(torch.as_tensor(normal, dtype=torch.float32))
        condition = policy.encode(policy.preprocess(observations))
        scores.append(float(network.evaluate(condition, codes[:, None]).mean()))
    assert scores[1] > scores[0]
