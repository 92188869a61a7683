"""Own loss: low of what the policy draws, high of what it would not, and of no other head."""

import copy
from dataclasses import replace

import numpy as np
import pytest
import torch

from genpolicy.monitors.own_loss import OwnLoss
from genpolicy.monitors.protocol import NO_WEIGHTS, Unavailable
from genpolicy.policies.policy import NetworkPolicy


@pytest.mark.parametrize("method", ["flow", "diffusion"])
def test_what_it_would_not_draw_scores_higher(kit, method):
    monitor = OwnLoss.fitted(kit.fit(method))
    own = [kit.invocation(method, name=name) for name in range(6)]
    odd = [replace(one, chunks=np.zeros_like(one.chunks)) for one in own]  # between both modes
    score = [np.mean([monitor.score(one) for one in many]) for many in (own, odd)]
    assert 0 < score[0] < score[1]


def test_the_same_invocation_has_the_same_score(kit):
    monitor = OwnLoss.fitted(kit.fit("flow"))
    assert monitor.score(kit.invocation()) == monitor.score(kit.invocation())
    assert monitor.score(kit.invocation()) != monitor.score(kit.invocation(name=1))


def test_who_denoises_nothing_has_none(kit):
    found = OwnLoss.fitted(kit.fit("chunked_bc"))
    assert isinstance(found, Unavailable)
    assert found.why == "chunked_bc is trained to denoise nothing"
    assert OwnLoss.fitted(kit.fit()) is NO_WEIGHTS


@pytest.mark.skipif(
    not torch.cuda.is_available(), reason="torch finds no CUDA device on this machine"
)
@pytest.mark.parametrize("method", ["flow", "diffusion"])
def test_a_policy_on_a_cuda_device_is_scored_there(kit, method):
    """Its noises are that device's, so that scores of two devices are not compared."""
    fit = kit.fit(method)
    there = NetworkPolicy(copy.deepcopy(fit.policy.checkpoint), device="cuda")
    monitor = OwnLoss.fitted(replace(fit, policy=there))
    one = kit.invocation(method)
    assert 0 < monitor.score(one) == monitor.score(one)
