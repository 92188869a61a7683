"""The latency benchmark on a tiny policy, and fresh processes."""

import numpy as np
import pytest

from genpolicy.candidates.brought import BroughtPolicy
from genpolicy.candidates.joining import JoiningSettings
from genpolicy.candidates.wire.extension import WORD
from genpolicy.candidates.wire.policy import WirePolicy
from genpolicy.candidates.wire.remote import RemotePolicy
from genpolicy.evidence.reproducibility.benchmark import invoke, measure_policy
from genpolicy.policies.fixtures import fixture_observations
from genpolicy.policies.policy import NetworkPolicy, load_policy
from tests.candidates.conftest import entry_of, serving  # noqa: F401
from tests.candidates.wire.test_remote import Planted

METHODS = ("bc", "flow")


@pytest.fixture(scope="module")
def observations(data, kit):
    return fixture_observations(data, horizons=kit.HORIZONS, count=4)


@pytest.mark.parametrize("method", ["bc", "flow"])
def test_components_and_temperatures(fleet, method, observations):
    projected = []
    rows = measure_policy(
        fleet[0] / method / "seed_0",
        observations,
        expected_sha256=None,
        device="cpu",
        cold_repeats=2,
        warm_repeats=3,
        discarded_repeats=1,
        project=lambda proposal, place: projected.append((proposal, place)),
    )
    found = {(row.component, row.temperature, row.repeat) for row in rows}
    assert found == {
        (component, temperature, repeat)
        for component in ("preprocess", "encode", "sample", "select", "project")
        for temperature, count in (("cold", 2), ("warm", 3))
        for repeat in range(count)
    }
    assert all(row.seconds > 0 for row in rows)
    assert len(projected) == 6
    assert projected[0][0].selected_by == "first_admissible"


def test_a_chunk_is_judged_where_it_was_drawn_for(fleet, observations):
    """However many are cold: the first warm one is of the first observation again."""
    judged, folder = [], fleet[0] / "bc" / "seed_0"
    measure_policy(
        folder, observations, expected_sha256=None, device="cpu", cold_repeats=3,
        warm_repeats=5, discarded_repeats=1,
        project=lambda proposal, place: judged.append((proposal.actions, place)),
    )  # fmt: skip
    policy = load_policy(folder, expected_sha256=None, device="cpu")
    names = [("any", place) for place in range(len(observations))]
    chunks = policy.sample(observations, noise_names=names, candidates=1).actions[:, 0]
    assert [place for _, place in judged] == [0, 1, 2, 0, 1, 2, 3, 0, 1]
    assert len(np.unique(chunks, axis=0)) == len(observations)
    for actions, place in judged:
        assert np.abs(actions - chunks[place]).max() < 1e-5


@pytest.mark.parametrize(
    ("method", "rule"),
    [
        *((method, rule) for rule in ("ensemble_oldest", "bidirectional") for method in METHODS),
        ("flow", "real_time"),
        ("flow", "warm_start"),  # the other cannot be guided: refused where the setting is read
    ],
)
def test_what_is_timed_is_joined_as_it_is_deployed(fleet, observations, monkeypatch, method, rule):
    given, proposed, plain = [], [], NetworkPolicy.sample_encoded

    def spied(self, condition, *, prefix, **others):
        given.append(prefix)
        return plain(self, condition, prefix=prefix, **others)

    monkeypatch.setattr(NetworkPolicy, "sample_encoded", spied)
    measure_policy(
        fleet[0] / method / "seed_0", observations, expected_sha256=None, device="cpu",
        cold_repeats=1,
        warm_repeats=1, discarded_repeats=0, candidates=2,
        project=lambda proposal, _: proposed.append(proposal),
        joining=JoiningSettings(rule=rule),
    )  # fmt: skip
    assert len(given) == len(proposed) == 2  # no sample beside those that are timed
    assert all((one is not None) == (rule in {"real_time", "warm_start"}) for one in given)
    if rule == "real_time":
        assert all((one.weights > 0).sum() == 7 for one in given)
    if rule == "warm_start":
        assert all((one.weights == 1).all() and one.strength == 0.5 for one in given)
    blends = rule == "ensemble_oldest" and method == "flow"
    assert all((one.selected_by == rule) == blends or method == "bc" for one in proposed)


def test_without_a_projection_the_term_stays_unknown(fleet, observations):
    rows = measure_policy(
        fleet[0] / "bc" / "seed_0", observations, expected_sha256=None, device="cpu",
        cold_repeats=1, warm_repeats=1,
    )  # fmt: skip
    assert "project" not in {row.component for row in rows}


def test_as_many_candidates_are_drawn_as_are_deployed(fleet, observations, monkeypatch):
    asked = []
    plain = NetworkPolicy.sample_encoded

    def spied(self, condition, *, candidates, **others):
        asked.append(candidates)
        return plain(self, condition, candidates=candidates, **others)

    monkeypatch.setattr(NetworkPolicy, "sample_encoded", spied)
    measure_policy(
        fleet[0] / "flow" / "seed_0", observations, expected_sha256=None, device="cpu",
        cold_repeats=1,
        warm_repeats=2, discarded_repeats=1, candidates=4,
    )  # fmt: skip
    assert asked == [4] * 4


class SelectsToo(Planted):
    """Chooses among chunks of its own, a second long by what it states."""

    def __init__(self):
        super().__init__(spans=["preprocess", "encode", "sample", "select"])
        self.changes = {"spans_s": {**dict.fromkeys(self.can["spans"], 0.0), "select": 1.0}}


def test_what_a_server_takes_to_select_is_added_to_what_it_takes_here(
    serving, entry_of, task, tmp_path  # noqa: F811
):  # fmt: skip
    """Red before: it was in `sample`, and of two spans of one term the later one counted."""
    planted, entry = SelectsToo(), entry_of()
    with serving(planted, {WORD: planted.can}) as address:
        remote = RemotePolicy(entry, address, task.observation)
        brought = BroughtPolicy("planted", tmp_path / "planted.yaml", entry, "c" * 64, 0)
        policy = WirePolicy(brought, remote)
        terms = invoke(policy, np.zeros((1, 2, task.observation.dim)), repeat=0, candidates=1)
        remote.close()
    assert set(terms) == {"preprocess", "encode", "sample", "select"}
    assert terms["select"] > 1.0
    assert terms["sample"] >= 0.0
