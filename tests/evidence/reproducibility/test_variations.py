"""A sample is its name's: company, turn and threads change no bit of ours, and are seen if they do.

Planted are the ways in which a policy comes to depend on them: statistics of a batch, a state that
questions leave behind, the place in a batch, and a sum that is split over threads.
"""

import itertools

import numpy as np
import pytest
import torch

from genpolicy.candidates.brought import BroughtPolicy
from genpolicy.candidates.hosts.kinds import read_entry
from genpolicy.candidates.judged import trained
from genpolicy.candidates.wire.policy import THREAD_VARIABLES, running
from genpolicy.candidates.wire.served import ServedPolicy
from genpolicy.contract.action import ACTION_COMPONENTS
from genpolicy.evidence.reproducibility import variations
from genpolicy.evidence.reproducibility.variations import (
    COMPANY,
    OTHER_THREADS,
    Varied,
    of_threads,
    trained_otherwise,
    wire_otherwise,
)
from genpolicy.evidence.rows.reproducibility import ALONE, ORDER, THREADS, TOGETHER, VARIATIONS
from genpolicy.integrity.hashing import sha256_bytes
from genpolicy.policies.fixtures import CANDIDATES, fixture_observations
from genpolicy.policies.policy import load_policy
from genpolicy.policies.protocol import Samples
from tests.candidates.conftest import entry_of, serving  # noqa: F401
from tests.candidates.hosts.conftest import onnx_data, torch_data, written  # noqa: F401


@pytest.fixture(scope="module")
def seen(data, kit):
    return fixture_observations(data, horizons=kit.HORIZONS, count=5)


def red(varied):
    """Ways in which something differs."""
    rows = varied.rows("flow", seed=0, device="cpu")
    assert all((row.unequal > 0) == (row.max_abs_difference > 0) for row in rows if not row.unknown)
    return {row.variation for row in rows if row.unequal}


def test_no_bit_of_ours_depends_on_company_turn_or_threads(fleet, dataset, kit):
    candidates = trained(fleet[0], ["flow", "chunked_bc"], seeds=[0], device="cpu")
    counts = {("flow", 0): 5, ("chunked_bc", 0): 3}
    rows = trained_otherwise(candidates, dataset, horizons=kit.HORIZONS, counts=counts)
    assert {(row.unequal, row.max_abs_difference, row.unknown) for row in rows} == {(0, 0.0, "")}
    named = [(row.method, row.variation, row.component) for row in rows]
    whole = itertools.product(("flow", "chunked_bc"), VARIATIONS, ACTION_COMPONENTS)
    assert sorted(named) == sorted(whole)
    chunks = {(row.method, row.variation): row.chunks for row in rows}
    assert chunks["flow", ALONE] == 5 and chunks["chunked_bc", THREADS] == 3 * CANDIDATES


class Planted:
    """A policy whose answer has something added: `more(actions, call)` of its shape."""

    def __init__(self, policy, more):
        self._policy, self._more, self._calls = policy, more, itertools.count()

    def sample(self, observations, **named):
        drawn = self._policy.sample(observations, **named)
        return Samples(drawn.actions + self._more(drawn.actions, next(self._calls)), drawn.nfe)


def of_its_batch(actions, _):
    return 1e-3 * actions.mean(axis=(0, 1), keepdims=True)


def of_its_turn(actions, call):
    return np.full(actions.shape, 1e-4 * call)


def of_its_place(actions, _):
    return np.broadcast_to(1e-4 * np.arange(len(actions))[:, None, None, None], actions.shape)


def of_the_threads(actions, _):
    return np.full(actions.shape, 1e-6 * torch.get_num_threads())


@pytest.mark.parametrize(
    ("more", "ways"),
    [(of_its_batch, {ALONE, TOGETHER}), (of_its_turn, set(VARIATIONS)),
     (of_its_place, {ALONE, ORDER}), (of_the_threads, {THREADS})],
)  # fmt: skip
def test_what_depends_on_more_than_its_name_is_seen_by_its_way(policy, seen, more, ways):
    before = torch.get_num_threads()
    found = red(of_threads(Planted(policy, more), seen))
    # The mean of a batch in another order may round otherwise, and that is seen too.
    assert ways <= found <= (ways | ({ORDER} if more is of_its_batch else set()))
    assert torch.get_num_threads() == before


def test_a_network_with_statistics_of_its_batch_is_seen(fleet, seen):
    """Padding to one number of rows does not help it: the other rows are others."""
    policy = load_policy(fleet[0] / "flow" / "seed_0")
    network = policy.checkpoint.network
    honest = network.encode
    network.encode = lambda rows: honest(rows) - honest(rows).mean(dim=0, keepdim=True)
    assert {ALONE, TOGETHER} & red(of_threads(policy, seen))


def test_a_component_alone_is_named_and_a_number_that_is_none_is_no_zero():
    plain = np.zeros((2, 1, 3, len(ACTION_COMPONENTS)))
    other = plain.copy()
    other[1, 0, 2, 4] = -0.5
    rows = Varied({ORDER: (other, plain)}, {THREADS: "why"}).rows("m", seed=1, device="cpu")
    told = {row.component: (row.chunks, row.unequal, row.max_abs_difference) for row in rows[:10]}
    assert told.pop(ACTION_COMPONENTS[4]) == (2, 1, 0.5)
    assert set(told.values()) == {(2, 0, 0.0)}
    assert {(r.variation, r.chunks, r.max_abs_difference, r.unknown) for r in rows[10:]} == {
        (THREADS, 0, None, "why")
    }
    other[0, 0, 0, 0] = np.nan
    first = Varied({ORDER: (other, other)}).rows("m", seed=1, device="cpu")[0]
    assert first.unequal == 1 and np.isnan(first.max_abs_difference)


class OfItsMessage(ServedPolicy):
    """Subtracts a part of the mean of the chunks of a message."""

    def answer(self, message):
        answer = super().answer(message)
        return answer | {"actions": answer["actions"] - 1e-3 * answer["actions"].mean(axis=0)}


class Remembers(ServedPolicy):
    """Adds what the last question left behind."""

    left = 0.0

    def answer(self, message):
        answer = super().answer(message)
        before, self.left = self.left, 1e-3 * float(message["observation"][-1, 0])
        return answer | {"actions": answer["actions"] + before}


@pytest.fixture
def asked(serving, entry_of, task, seen, tmp_path):  # noqa: F811
    """Ways of a server that runs already."""

    def ask(served, metadata=None, first=0.0, **fields):
        with serving(served.answer, metadata or served.metadata) as address:
            entry = entry_of(address=address, **fields)
            brought = BroughtPolicy("planted", tmp_path / "planted.yaml", entry, "c" * 64, 0)
            first = np.full((len(seen), CANDIDATES, 16, 10), first)
            return wire_otherwise(brought, task.observation, seen, first, scene=task.scene_path)

    return ask


def test_behind_the_wire_company_and_turn_are_seen_and_threads_of_another_start_unknown(
    asked, policy
):
    honest = asked(ServedPolicy(policy))
    assert red(honest) == set() and set(honest.unknown) == {THREADS}
    assert set(honest.pairs) == {ALONE, TOGETHER, ORDER}
    assert {ALONE, TOGETHER} <= red(asked(OfItsMessage(policy)))
    assert ORDER in red(asked(Remembers(policy)))


@pytest.mark.parametrize(
    ("most", "unknown"),
    [(1, {ALONE, TOGETHER, THREADS}), (CANDIDATES, {TOGETHER, THREADS}), (COMPANY, {THREADS})],
)
def test_a_server_that_draws_few_at_once_has_no_other_batch(asked, policy, most, unknown):
    served = ServedPolicy(policy)
    metadata = {"genpolicy": {**served.metadata["genpolicy"], "candidates": most}}
    found = asked(served, metadata)
    assert set(found.unknown) == unknown and set(found.pairs) == set(VARIATIONS) - unknown


def test_one_that_answered_nothing_is_not_asked_again(asked, policy, monkeypatch):
    monkeypatch.setattr(variations, "running", None)  # nobody is started
    served = ServedPolicy(policy)
    found = asked(served, first=np.nan)
    assert found.pairs == {} and set(found.unknown) == set(VARIATIONS)


def test_one_that_always_draws_the_same_has_no_other_batch(asked, policy):
    found = asked(ServedPolicy(policy), stochastic=False)
    assert set(found.unknown) == {ALONE, TOGETHER, THREADS}


PLANNER = f"""
import os
import numpy as np
def plan(given):
    return np.full((16, 10), sum(float(os.environ[name]) for name in {THREAD_VARIABLES}))
"""


@pytest.fixture
def planned(written, task, seen, tmp_path):  # noqa: F811
    """Ways of a planner whose code is given, against what its first start answered."""

    def ask(code, own, **changes):
        path = written(
            "scripted", files={"planner.py": sha256_bytes(code.encode())}, declared=None, **changes
        )
        (tmp_path / "planner.py").write_text(code)
        entry = read_entry(path)
        brought = BroughtPolicy("planted", path, entry, entry.sha256, 0)
        own = np.full((len(seen), CANDIDATES, 16, 10), float(own))
        return wire_otherwise(brought, task.observation, seen, own, scene=task.scene_path)

    return ask


@pytest.mark.parametrize(("declared", "other"), [(1, OTHER_THREADS), (2, 1), (4, OTHER_THREADS)])
def test_another_start_has_other_threads_and_is_held_against_the_first(planned, declared, other):
    own = len(THREAD_VARIABLES) * declared
    found = planned(PLANNER, own, threads=declared)
    drawn, plain = found.pairs[THREADS]
    assert (drawn == len(THREAD_VARIABLES) * other).all() and (plain == own).all()
    assert red(found) == {THREADS} and set(found.unknown) == {ALONE, TOGETHER}


def test_who_may_not_have_obeyed_is_unknown_and_a_program_is_not(planned, written, task, seen):  # noqa: F811
    found = planned("import numpy as np\ndef plan(given):\n    return np.ones((16, 10))", 1)
    assert found.unknown[THREADS] == "told, and may not obey; nothing differed"
    path = written("torch")
    entry = read_entry(path)
    brought = BroughtPolicy("planted", path, entry, entry.sha256, 0)
    with running(brought, task.observation, scene=task.scene_path) as policy:
        own = variations.plainly(policy, seen)
    found = wire_otherwise(brought, task.observation, seen, own, scene=task.scene_path)
    assert THREADS in found.pairs and THREADS not in found.unknown
