"""Fixtures come back on the CPU as they were trained, and on another device as they were there."""

import math
from dataclasses import replace

import pytest
import torch

from genpolicy.candidates.judged import trained
from genpolicy.errors import ConfigError
from genpolicy.evidence.reproducibility import fixtures
from genpolicy.evidence.reproducibility.fixtures import fixtures_again
from genpolicy.policies.fixtures import fixture_observations, fixture_rows
from genpolicy.policies.policy import NetworkPolicy

ELSEWHERE = "cpu:0"
"""A device that every machine has, and that is not the word `cpu`."""


@pytest.fixture
def before(policy, data, kit):
    seen = fixture_observations(data, horizons=kit.HORIZONS, count=3)
    return fixture_rows(policy, seen, method="flow", seed=0)


@pytest.fixture
def here(monkeypatch):
    """Where every draw is made, in the order in which they are."""
    found, draw = [], NetworkPolicy.sample_encoded

    def spied(policy, *words, **named):
        found.append(policy.device)
        return draw(policy, *words, **named)

    monkeypatch.setattr(NetworkPolicy, "sample_encoded", spied)
    monkeypatch.setattr(fixtures, "in_fresh_process", lambda work, *a, **k: work(*a, **k))
    return found


def test_on_the_cpu_training_and_one_reload_are_compared(fleet, dataset, before, kit, here):
    (flow,) = trained(fleet[0], ["flow"], seeds=[0], device="cpu")
    rows, counted, differing = fixtures_again(flow, before, dataset, horizons=kit.HORIZONS)
    assert [(row.device, row.max_abs_difference) for row in rows] == [("cpu", 0.0)] * 3
    assert (counted, differing, here) == (2, 0, ["cpu"])


def test_elsewhere_two_processes_are_compared_too(fleet, dataset, before, kit, here):
    (flow,) = trained(fleet[0], ["flow"], seeds=[0], device=ELSEWHERE)
    rows, _, differing = fixtures_again(flow, before, dataset, horizons=kit.HORIZONS)
    assert [row.device for row in rows] == ["cpu"] * 3 + [ELSEWHERE] * 3
    assert {row.max_abs_difference for row in rows} == {0.0} and differing == 0
    assert here == ["cpu", ELSEWHERE, ELSEWHERE]


def test_a_device_that_draws_otherwise_the_second_time_is_seen(
    fleet, dataset, before, kit, here, monkeypatch
):
    (flow,) = trained(fleet[0], ["flow"], seeds=[0], device=ELSEWHERE)
    draw = NetworkPolicy.sample

    def drifting(policy, *words, **named):
        drawn = draw(policy, *words, **named)
        off = 1e-6 * here.count(ELSEWHERE) if policy.device == ELSEWHERE else 0.0
        return replace(drawn, actions=drawn.actions + off)

    monkeypatch.setattr(NetworkPolicy, "sample", drifting)
    rows, _, _ = fixtures_again(flow, before, dataset, horizons=kit.HORIZONS)
    assert [row.max_abs_difference > 0.0 for row in rows] == [False] * 3 + [True] * 3


def test_what_is_no_number_there_is_a_row_and_no_end(
    fleet, dataset, before, kit, here, monkeypatch
):
    (flow,) = trained(fleet[0], ["flow"], seeds=[0], device=ELSEWHERE)
    draw = NetworkPolicy.sample

    def diverging(policy, *words, **named):
        drawn = draw(policy, *words, **named)
        return replace(drawn, actions=drawn.actions * (math.inf if policy.device != "cpu" else 1))

    monkeypatch.setattr(NetworkPolicy, "sample", diverging)
    rows, _, _ = fixtures_again(flow, before, dataset, horizons=kit.HORIZONS)
    assert [math.isnan(row.max_abs_difference) for row in rows] == [False] * 3 + [True] * 3


def test_a_device_that_is_not_there_is_said_by_the_process_that_looked(fleet, dataset, before, kit):
    if torch.cuda.is_available():
        pytest.skip("this machine has the device")
    (flow,) = trained(fleet[0], ["flow"], seeds=[0], device="cuda")
    with pytest.raises(ConfigError, match="'cuda', which this machine does not have"):
        fixtures_again(flow, before, dataset, horizons=kit.HORIZONS)
