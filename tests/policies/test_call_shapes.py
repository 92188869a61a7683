"""Rows of a network call: few where that changes nothing, and as ever where it would."""

import pytest
import torch

from genpolicy.policies import call_shapes as module
from genpolicy.policies.call_shapes import SPREAD, TRIED, CallShapes, call_shapes, equal_sizes
from genpolicy.policies.policy import load_policy

INPUTS = [torch.arange(float(SPREAD))[:, None]]


def test_the_smallest_size_that_holds_the_rows_is_taken():
    calls = CallShapes((4, 16, 32))
    assert [calls.fit(count) for count in (1, 4, 5, 16, 17, 32, 33)] == [4, 4, 16, 16, 32, 32, 32]
    assert calls.most == 32


def test_what_treats_rows_alone_may_have_any_number_of_them():
    assert equal_sizes(lambda rows: rows[0] ** 2, INPUTS, size=16) == tuple(sorted((*TRIED, 16)))


@pytest.mark.parametrize(
    ("call", "left"),
    [
        (lambda rows: rows[0] + (len(rows[0]) == 4) * 1e-6 * (rows[0] > 30), (8, 16, 32)),
        (lambda rows: rows[0] + 1e-6 * len(rows[0]), (16,)),
        (lambda rows: rows[0] + 1e-6 * torch.arange(len(rows[0]))[:, None], (16,)),
        (lambda rows: torch.where(rows[0] == 31, torch.nan, rows[0]), (16,)),
    ],
    ids=["one row of small calls", "every size", "the place in the call", "NaN is equal to none"],
)
def test_a_size_with_other_bits_is_not_used(call, left):
    assert equal_sizes(call, INPUTS, size=16) == left


def test_a_network_whose_small_calls_differ_keeps_the_size_that_defines_it(folders, monkeypatch):
    """As products of one and two rows do here; the samples are those of before."""
    monkeypatch.setattr(module, "_measured", {})
    policy = load_policy(folders["flow"])
    network, config = policy.checkpoint.network, policy.checkpoint.config
    assert policy._calls.sizes == call_shapes(network, config, policy.sampler, device="cpu").sizes
    honest = network.encode
    monkeypatch.setattr(network, "encode", lambda seen: honest(seen) * (1 + 1e-6 * (len(seen) < 9)))
    monkeypatch.setattr(module, "_measured", {})
    spoiled = call_shapes(network, config, policy.sampler, device="cpu").sizes
    assert 16 in spoiled and not {4, 8} & set(spoiled)


def test_a_time_at_which_the_network_says_nothing_hides_no_bit(folders, monkeypatch):
    """One jump begins at pure noise, where the gain of what the network says is next to nothing:
    tried at that time alone, all sizes came out equal, and other samplers took them over."""
    monkeypatch.setattr(module, "_measured", {})
    policy = load_policy(folders["manicm"])
    assert policy.sampler.steps == 1
    network, config = policy.checkpoint.network, policy.checkpoint.config
    honest = network.head.read_out
    monkeypatch.setattr(
        network.head, "read_out", lambda rows: honest(rows) * (1 + 1e-6 * (len(rows) < 9))
    )
    monkeypatch.setattr(module, "_measured", {})
    spoiled = call_shapes(network, config, policy.sampler, device="cpu").sizes
    assert 16 in spoiled and not {4, 8} & set(spoiled)


def test_the_search_of_an_energy_and_other_devices_keep_the_size(folders):
    policy = load_policy(folders["ibc"])
    assert policy._calls.sizes == (policy.sampler.batch_rows,)
    flow = load_policy(folders["flow"])
    shapes = call_shapes(
        flow.checkpoint.network, flow.checkpoint.config, flow.sampler, device="cuda:0"
    )
    assert shapes.sizes == (flow.sampler.batch_rows,)


def test_it_is_tried_once_for_networks_of_equal_sizes(folders, monkeypatch):
    monkeypatch.setattr(module, "_measured", {})
    tried, honest = [], module.equal_sizes

    def spy(*args, **rest):
        tried.append(1)
        return honest(*args, **rest)

    monkeypatch.setattr(module, "equal_sizes", spy)
    for method in ("flow", "flow", "diffusion", "flow"):
        load_policy(folders[method])
    assert len(tried) == 2
