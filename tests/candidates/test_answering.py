"""A sample that is given up at its sampler's cap costs its own invocation, and no other."""

import numpy as np
import pytest

from genpolicy.candidates.answering import AnsweringPolicy
from genpolicy.candidates.contenders import opened
from genpolicy.candidates.judged import sampling_by, trained
from genpolicy.errors import EvaluationCapError
from genpolicy.evidence.reproducibility.benchmark import invoke
from genpolicy.policies.fixtures import fixture_observations
from genpolicy.policies.prefix import Prefix
from genpolicy.policies.settings import SamplerConfig

ROWS, CANDIDATES = 6, 2
ADAPTIVE = SamplerConfig(name="bosh3", steps=4, tolerance=1e-4, nfe_cap=400)


def names(rows):
    return [("row", row) for row in rows]


@pytest.fixture(scope="module")
def seen(data, kit):
    return fixture_observations(data, horizons=kit.HORIZONS, count=ROWS)


@pytest.fixture(scope="module")
def counts(policy, seen):
    """Evaluations of each observation, asked alone without a cap that is reached."""
    free = sampling_by(policy, ADAPTIVE)
    found = [
        free.sample(seen[row : row + 1], noise_names=names([row]), candidates=CANDIDATES).nfe
        for row in range(ROWS)
    ]
    assert len(set(found)) > 1, "the rows must differ, or nothing is shown"
    return found


def test_one_hard_observation_costs_the_others_nothing(policy, seen, counts):
    free = sampling_by(policy, ADAPTIVE)
    whole = free.sample(seen, noise_names=names(range(ROWS)), candidates=CANDIDATES)
    capped = sampling_by(policy, ADAPTIVE.model_copy(update={"nfe_cap": max(counts) - 1}))
    with pytest.raises(EvaluationCapError):
        capped.sample(seen, noise_names=names(range(ROWS)), candidates=CANDIDATES)
    own = AnsweringPolicy(capped)
    drawn = own.sample(seen, noise_names=names(range(ROWS)), candidates=CANDIDATES)
    for row, count in enumerate(counts):
        if count == max(counts):
            assert np.isnan(drawn.actions[row]).all()
        else:
            assert np.array_equal(drawn.actions[row], whole.actions[row])
    assert own.given_up == counts.count(max(counts)) < ROWS
    assert drawn.actions.shape == whole.actions.shape and drawn.nfe < max(counts)


def test_what_never_reaches_its_cap_is_answered_as_ever_and_in_one_batch(policy, seen, counts):
    own = AnsweringPolicy(sampling_by(policy, ADAPTIVE))
    drawn = own.sample(seen, noise_names=names(range(ROWS)), candidates=CANDIDATES)
    plain = sampling_by(policy, ADAPTIVE).sample(
        seen, noise_names=names(range(ROWS)), candidates=CANDIDATES
    )
    assert np.array_equal(drawn.actions, plain.actions) and drawn.nfe == max(counts)
    assert (own.given_up, own.sampler_config_hash) == (0, ADAPTIVE.hash())


def test_who_goes_on_from_given_actions_keeps_the_row_of_each(policy, seen, monkeypatch):
    """Each observation that is asked again alone is given its own actions and weights."""
    own, asked = AnsweringPolicy(policy), []

    def drawing(policy, condition, *, noise_names, candidates, prefix):
        asked.append(prefix)
        if len(noise_names) > 1:
            raise EvaluationCapError(where="a", found="b", expected="c", action="d")
        return drawn

    drawn = policy.sample(seen[:1], noise_names=names([0]), candidates=1)
    monkeypatch.setattr("genpolicy.policies.policy.NetworkPolicy.sample_encoded", drawing)
    rows = policy.prediction_horizon
    given = Prefix(np.arange(3.0)[:, None, None], np.arange(3.0)[:, None] + np.ones(rows), 5.0)
    condition = own.encode(own.preprocess(seen[:3]))
    found = own.sample_encoded(condition, noise_names=names(range(3)), candidates=1, prefix=given)
    assert found.actions.shape[0] == 3 and asked[0] is given
    assert [p.actions.item() for p in asked[1:]] == [0.0, 1.0, 2.0]
    assert [p.weights[0, 0] for p in asked[1:]] == [1.0, 2.0, 3.0]


def test_whoever_opens_a_trained_policy_is_never_ended_by_its_cap(fleet, data, kit, monkeypatch):
    """The way of the sweep's times, of every rollout and of the monitors."""
    (flow,) = trained(fleet[0], ["flow"], seeds=[0], device="cpu")
    never = SamplerConfig(name="bosh3", steps=4, tolerance=1e-9, nfe_cap=10)
    hard = sampling_by(flow.load(), never)
    monkeypatch.setattr(type(flow), "load", lambda judged: hard)
    with opened(flow, data.observation_contract) as own:
        seen = fixture_observations(data, horizons=kit.HORIZONS, count=1)
        drawn = own.sample(seen, noise_names=names([0]), candidates=3)
        assert np.isnan(drawn.actions).all() and drawn.nfe <= 10
        spans = invoke(own, seen, repeat=0, candidates=3)
        assert own.given_up == 2 and spans["sample"] > 0.0
