"""Evaluations prepared ahead: the same bits as one by one, and every time is announced."""

import numpy as np
import pytest
import torch

from genpolicy.policies import policy as policy_module
from genpolicy.policies.ahead import TIMES_AHEAD, AheadNetwork, Conditions
from genpolicy.policies.checkpoint import load_checkpoint
from genpolicy.policies.methods import announced_times, generate
from genpolicy.policies.policy import load_policy
from genpolicy.policies.settings import SamplerConfig

SIZE = 16
WALKS = [
    ("diffusion", SamplerConfig(name="ddim", steps=7)),
    ("diffusion", SamplerConfig(name="ddim", steps=5, eta=1.0)),
    ("diffusion", SamplerConfig(name="ddpm", steps=100)),
    ("diffusion", SamplerConfig(name="dpm_2m", steps=6)),
    ("flow", SamplerConfig(name="euler", steps=4)),
    ("flow", SamplerConfig(name="heun", steps=3)),
    ("flow", SamplerConfig(name="rk4", steps=3)),
    ("flow_policy", SamplerConfig(name="consistency", steps=4)),
    ("manicm", SamplerConfig(name="multistep_consistency", steps=3)),
    ("ibc", SamplerConfig(name="derivative_free", steps=5, population=32)),
    ("ibc", SamplerConfig(name="langevin", steps=5, population=32)),
]
ADAPTIVE = ("flow", SamplerConfig(name="bosh3", steps=4, tolerance=1e-4, nfe_cap=400))


def named(walk):
    method, sampler = walk
    return f"{method}-{sampler.name}-{sampler.steps}-{sampler.eta}"


class OneByOne:
    """The network without anything ahead, every row with its own condition."""

    def __init__(self, network, conditions, *, finish=None, **_):
        self.evaluate, self.condition = network.evaluate, conditions.rows
        if finish is not None:
            self.evaluate = lambda rows, values, time: finish(network.prepare(rows), values)

    def __call__(self, values, time):
        return self.evaluate(self.condition, values, time)


def drawn(policy, seen, candidates):
    names = [("row", row) for row in range(len(seen))]
    return policy.sample(seen, noise_names=names, candidates=candidates).actions


@pytest.mark.parametrize("walk", [*WALKS, ADAPTIVE], ids=named)
@pytest.mark.parametrize(("rows", "candidates"), [(1, 1), (1, 8), (3, 3), (40, 1), (3, 20)])
def test_samples_are_those_of_whole_calls_one_by_one(
    folders, walk, rows, candidates, two_mode_windows, monkeypatch
):
    """By definition: rows of `batch_rows`, each evaluation computed whole."""
    method, sampler = walk
    seen = two_mode_windows(40, seed=9).observations[:rows]
    found = drawn(load_policy(folders[method], sampler=sampler), seen, candidates)
    monkeypatch.setattr("genpolicy.policies.methods.AheadNetwork", OneByOne)
    plain = load_policy(folders[method], sampler=sampler)
    plain._calls, plain._compiled = type(plain._calls)((SIZE,)), None
    assert drawn(plain, seen, candidates).tobytes() == found.tobytes()


def spied(monkeypatch):
    made = []

    class Spy(AheadNetwork):
        def __init__(self, *args, **rest):
            super().__init__(*args, **rest)
            made.append(self)

    monkeypatch.setattr("genpolicy.policies.methods.AheadNetwork", Spy)
    return made


@pytest.mark.parametrize("walk", WALKS, ids=named)
def test_a_sampler_asks_for_no_time_that_it_did_not_announce(
    folders, walk, two_mode_windows, monkeypatch
):
    """Such a time is evaluated all the same, and only takes longer: nothing else would show it."""
    method, sampler = walk
    made = spied(monkeypatch)
    drawn(load_policy(folders[method], sampler=sampler), two_mode_windows(2).observations[:1], 2)
    assert [one.unannounced for one in made] == [0]
    head = load_checkpoint(folders[method]).config.head
    assert len(announced_times(sampler, head)) > 0


def test_an_adaptive_solver_announces_nothing_and_is_evaluated_as_it_goes(
    folders, two_mode_windows, monkeypatch
):
    method, sampler = ADAPTIVE
    made = spied(monkeypatch)
    policy = load_policy(folders[method], sampler=sampler)
    found = policy.sample(two_mode_windows(2).observations[:1], noise_names=[("a",)], candidates=1)
    assert [one.unannounced for one in made] == [found.nfe]


def test_the_condition_of_an_observation_is_prepared_once_for_all_its_candidates(
    folders, two_mode_windows, monkeypatch
):
    policy = load_policy(folders["diffusion"], sampler=SamplerConfig(name="ddpm", steps=100))
    network, rows = policy.checkpoint.network, []
    honest = network.prepare
    monkeypatch.setattr(network, "prepare", lambda c, t: rows.append(len(c)) or honest(c, t))
    drawn(policy, two_mode_windows(2).observations[:1], 8)
    padding = 100 - 100 // TIMES_AHEAD * TIMES_AHEAD
    assert sum(rows) == 100 // TIMES_AHEAD * TIMES_AHEAD + policy._calls.fit(padding)


def test_a_row_reads_its_own_condition():
    stored = torch.arange(6.0).reshape(3, 2)
    conditions = Conditions(stored, torch.tensor([0, 0, 2, 1]))
    assert conditions.rows.tolist() == [[0, 1], [0, 1], [4, 5], [2, 3]]
    assert conditions.spread(stored)[2].tolist() == [4, 5]
    alone = Conditions(stored[:1], torch.zeros(4, dtype=torch.long))
    assert alone.spread(stored[:1]).shape == (1, 2), "one for all rows, not four copies"
    assert alone.rows.shape == (4, 2)


def test_a_swapped_condition_changes_the_sample(folders, two_mode_windows, monkeypatch):
    """The fault that the comparison above is for."""
    policy = load_policy(folders["flow"])
    seen = two_mode_windows(3, seed=9).observations
    honest, plain = policy_module.generate, drawn(policy, seen, 2)
    assert honest is generate

    def swapped(network, conditions, noise, **rest):
        other = Conditions(conditions.stored, conditions.of_row.flip(0))
        return honest(network, other, noise, **rest)

    monkeypatch.setattr(policy_module, "generate", swapped)
    assert not np.array_equal(drawn(policy, seen, 2), plain)
