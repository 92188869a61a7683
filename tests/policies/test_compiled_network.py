"""Evaluations by compiled products: the network's bits, or not used."""

import numpy as np
import pytest
import torch

from genpolicy.policies import call_shapes as module
from genpolicy.policies.ahead import AheadNetwork, Conditions
from genpolicy.policies.call_shapes import compiled_calls
from genpolicy.policies.compiled_network import CompiledNetwork
from genpolicy.policies.determinism import deterministic
from genpolicy.policies.methods import announced_times, generate, method_named, noise_shape
from genpolicy.policies.networks import Dimensions
from genpolicy.policies.policy import load_policy
from genpolicy.policies.prefix import Prefix
from genpolicy.policies.settings import HeadConfig, NetworkConfig, SamplerConfig

# A few more outputs than a library's smallest product has a kernel of its own for, a layer that is
# added up in one piece, and one that is added up in two.
SIZES = Dimensions(observation_horizon=2, observation_dim=3, prediction_horizon=8, action_dim=4)
NETWORK = NetworkConfig(
    encoder_width=16, condition_dim=16, trunk_width=208, trunk_blocks=2, time_features=16,
    head_parameters=30_000,
)  # fmt: skip
HEAD = HeadConfig(latent_dim=4, posterior_width=16)
SIZE = SamplerConfig(name="ddim").batch_rows
WALKS = [
    ("diffusion", SamplerConfig(name="ddim", steps=7)),
    ("diffusion", SamplerConfig(name="ddim", steps=5, eta=1.0)),
    ("diffusion", SamplerConfig(name="ddpm", steps=40)),
    ("diffusion", SamplerConfig(name="dpm_2m", steps=6)),
    ("flow", SamplerConfig(name="euler", steps=4)),
    ("flow", SamplerConfig(name="rk4", steps=3)),
    ("flow_policy", SamplerConfig(name="consistency", steps=4)),
    ("manicm", SamplerConfig(name="multistep_consistency", steps=3)),
]


class Config:
    """What a trial asks of a checkpoint's configuration."""

    def __init__(self, method, network=NETWORK):
        self.method, self.dimensions, self.network, self.head = method, SIZES, network, HEAD


def made(method, network=NETWORK):
    """Weights that are all in use: those of a new network leave layers at zero."""
    built = method_named(method).build(SIZES, network, HEAD)
    generator = torch.Generator().manual_seed(1)
    with torch.no_grad():
        for parameter in built.parameters():
            parameter.copy_(0.1 * torch.randn(parameter.shape, generator=generator))
    return built.requires_grad_(requires_grad=False)


def calls_of(method, sampler, network=None, most=32, device="cpu"):
    network = network or made(method)
    return compiled_calls(network, Config(method), sampler, most=most, device=device)


@pytest.fixture
def used():
    """This machine's library adds up as the compiled products do; elsewhere they are not used."""
    if calls_of(*WALKS[0]) is None:
        pytest.skip("this machine's matrix library adds up in another order")


def rows_of(network, count, seed=2):
    generator = torch.Generator().manual_seed(seed)
    seen = torch.randn((count, 2, 3), generator=generator)
    return torch.cat([network.encode(seen[row : row + 1].expand(SIZE, -1, -1))[:1]
                      for row in range(count)])  # fmt: skip


@pytest.mark.usefixtures("used")
@pytest.mark.parametrize("walk", WALKS, ids=lambda walk: f"{walk[0]}-{walk[1].name}")
@pytest.mark.parametrize("rows", [1, 2, 8, 16])
@pytest.mark.parametrize("observations", [1, 2])
def test_a_sample_has_the_bits_of_whole_calls_of_torch(walk, rows, observations):
    method, sampler = walk
    network = made(method)
    shape = noise_shape(SIZES, sampler, HEAD)
    of_row = torch.arange(SIZE) * observations // rows % observations
    calls = calls_of(method, sampler, network)
    with deterministic("cpu"), torch.inference_mode():
        stored = rows_of(network, observations)

        def noise(step):
            return torch.randn((SIZE, *shape), generator=torch.Generator().manual_seed(step))

        def drawn(count, finish):
            return generate(
                network, Conditions(stored, of_row[:count]), lambda step: noise(step)[:count],
                sampler=sampler, head=HEAD, call_rows=lambda _: SIZE, finish=finish,
            )  # fmt: skip

        expected, nfe = drawn(SIZE, None)
        found, counted = drawn(rows, calls.finish(rows))
    assert found.numpy().tobytes() == expected[:rows].numpy().tobytes()
    assert counted == nfe
    assert float(found.std()) > 0.0


@pytest.mark.usefixtures("used")
def test_two_runs_do_not_share_their_room():
    network, (method, sampler) = made("flow"), WALKS[4]
    one, other = (calls_of(method, sampler, network).finish(2) for _ in range(2))
    with deterministic("cpu"), torch.inference_mode():
        prepared = network.prepare(rows_of(network, 2), torch.full((2,), 0.5))
        values = torch.randn((2, 8, 4), generator=torch.Generator().manual_seed(0))
        first = one(prepared, values)
        kept = first.clone()
        other(prepared, -values)
        one(prepared, 2.0 * values)
    assert torch.equal(first, kept)
    assert all(
        left.ctypes.data != right.ctypes.data
        for name, left in vars(one.__self__).items()
        if isinstance(left, np.ndarray)
        for right in (getattr(other.__self__, name),)
    )


@pytest.mark.usefixtures("used")
@pytest.mark.parametrize(
    ("spoil", "left"),
    [
        (lambda out: out * (1 + 1e-6), None),
        (lambda out: torch.where(torch.arange(len(out))[:, None, None] == 3, 0.0, out), (1, 2)),
        (lambda out: out + (len(out) == 1) * 1e-6, (2, 8, 16, 24, 32)),
        (lambda out: torch.full_like(out, torch.nan), None),
    ],
    ids=["every bit", "the fourth row", "one row alone", "NaN is equal to none"],
)
def test_only_what_has_the_networks_bits_is_used(spoil, left, monkeypatch):
    honest = CompiledNetwork.finish

    def spoiled(self, rows):
        own = honest(self, rows)
        return lambda prepared, values: spoil(own(prepared, values))

    monkeypatch.setattr(module, "_measured_compiled", {})
    monkeypatch.setattr(CompiledNetwork, "finish", spoiled)
    calls = calls_of(*WALKS[0])
    assert (calls and calls.shapes.sizes) == left


@pytest.mark.usefixtures("used")
def test_another_order_of_the_sums_is_seen(monkeypatch):
    """As on a machine whose library takes other blocks."""
    monkeypatch.setattr(module, "_measured_compiled", {})
    monkeypatch.setattr("genpolicy.policies.compiled_network.BLOCK", 100)
    assert calls_of(*WALKS[0]) is None


@pytest.mark.usefixtures("used")
def test_no_call_has_more_rows_than_one_of_the_network():
    assert calls_of(*WALKS[0], most=16).shapes.sizes == (1, 2, 8, 16)


@pytest.mark.parametrize(
    ("method", "sampler", "network", "device"),
    [
        ("flow", SamplerConfig(name="bosh3", steps=4, nfe_cap=99), NETWORK, "cpu"),
        ("act", SamplerConfig(name="z_zero"), NETWORK, "cpu"),
        ("bc_noise", SamplerConfig(name="offset"), NETWORK, "cpu"),
        ("ibc", SamplerConfig(name="langevin", steps=2, population=32), NETWORK, "cpu"),
        ("flow", SamplerConfig(name="euler"), NETWORK.model_copy(update={"trunk": "transformer"}),
         "cpu"),
        ("flow", SamplerConfig(name="euler"), NETWORK, "cuda:0"),
    ],
    ids=["times not announced", "one pass", "an offset", "an energy", "a transformer", "a GPU"],
)  # fmt: skip
def test_others_stay_with_torch(method, sampler, network, device):
    built = method_named(method).build(SIZES, network, HEAD)
    assert compiled_calls(built, Config(method, network), sampler, most=32, device=device) is None


def test_a_time_that_was_not_announced_is_evaluated_in_a_call_of_the_network(monkeypatch):
    """Of one row torch would make other bits; compiled products know no time ahead of its call."""
    network, rows = made("flow"), []
    honest = network.evaluate

    def spied(condition, values, time):
        rows.append((len(condition), len(values), len(time)))
        return honest(condition, values, time)

    monkeypatch.setattr(network, "evaluate", spied)
    with deterministic("cpu"), torch.inference_mode():
        conditions = Conditions(rows_of(network, 1), torch.zeros(3, dtype=torch.long))
        ahead = AheadNetwork(network, conditions, times=announced_times(*WALKS[4][1:], HEAD),
                             call_rows=lambda _: SIZE)  # fmt: skip
        assert ahead(torch.zeros(3, 8, 4), torch.full((3,), 0.123)).shape == (3, 8, 4)
    assert (rows, ahead.unannounced) == ([(SIZE, SIZE, SIZE)], 1)


def test_values_of_another_shape_are_not_read():
    """Compiled code looks at no bounds."""
    network = made("flow")
    finish = CompiledNetwork(network).finish(2)
    with torch.inference_mode():
        prepared = network.prepare(rows_of(network, 2), torch.full((2,), 0.5))
        three = network.prepare(rows_of(network, 3), torch.full((3,), 0.5))
        with pytest.raises(AssertionError):
            finish(prepared, torch.zeros(2, 9, 4))
        with pytest.raises(AssertionError):
            finish(three, torch.zeros(2, 8, 4))


def test_what_is_guided_is_differentiated_and_left_to_torch(folders, two_mode_windows):
    policy = load_policy(folders["flow"])
    seen = two_mode_windows(1).observations
    prefix = Prefix(np.zeros((1, 4, 2)), np.ones((1, 4)), bound=5.0)
    honest = policy.sample(seen, noise_names=[("a",)], candidates=2, prefix=prefix).actions

    def refused(_):
        raise AssertionError("compiled products have no gradient")

    policy._compiled = module.CompiledCalls(module.CallShapes((1, 2)), refused)
    found = policy.sample(seen, noise_names=[("a",)], candidates=2, prefix=prefix).actions
    assert found.tobytes() == honest.tobytes()
    with pytest.raises(AssertionError, match="no gradient"):
        policy.sample(seen, noise_names=[("a",)], candidates=2)
