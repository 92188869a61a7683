"""A policy that was brought is started twice: what does not come back the same shows."""

import itertools
import sys

import numpy as np
import pytest

from gates.reproducibility.identity import unrecorded
from genpolicy.candidates.brought import BroughtPolicy
from genpolicy.candidates.judged import sampling_by
from genpolicy.candidates.wire import remote
from genpolicy.candidates.wire.served import ServedPolicy
from genpolicy.evidence.need.held_out import held_out_situations
from genpolicy.evidence.reproducibility.brought import Asked, ask_brought
from genpolicy.evidence.reproducibility.identity import Deployment
from genpolicy.policies.settings import SamplerConfig
from tests.candidates.conftest import entry_of, serving  # noqa: F401

DECLARED = {
    "dataset": "d" * 64, "split": "e" * 64, "training_seed": 7, "architecture": "small",
    "parameters": 1000, "path": "straight", "sampler": "euler", "sampler_steps": 2,
    "evaluations": 2, "precision": "float32", "device": "cpu", "threads": 1,
    "cpu_capability": "AVX2", "batch_rows": 1,
}  # fmt: skip


@pytest.fixture
def asking(data, task, checker, kit, tmp_path):
    audit = kit.write_situations(tmp_path / "audit", [(kit.uuids(data)[8], 4, {})])
    held_out = held_out_situations(audit, data, horizons=kit.HORIZONS)
    deployment = Deployment(kit.HORIZONS, deadline_s=0.15, samples=2, replan_lead_rows=3)
    return Asked(data, task, checker, held_out, 2, deployment, root_seed=3)


@pytest.fixture
def answered(asking, serving, entry_of, tmp_path):  # noqa: F811
    """What a server of some metadata and answers answers, as evidence."""

    def ask(answer, metadata, declared=DECLARED, **fields):
        with serving(answer, metadata) as address:
            entry = entry_of(address=address, declared=declared, **fields)
            brought = BroughtPolicy("planted", tmp_path / "planted.yaml", entry, "c" * 64, 0)
            return ask_brought(brought, asking)

    return ask


def test_our_own_weights_behind_the_wire_come_back_the_same(answered, policy):
    served = ServedPolicy(policy)
    found = answered(served.answer, served.metadata)
    assert len(found.samples) == 32
    assert {row.max_abs_difference for row in found.samples} == {0.0}
    assert all(row.sha256_trained == row.sha256_reloaded for row in found.samples)
    (nfe,) = found.nfe
    assert (nfe.recorded, nfe.counted, nfe.expected) == (2, 2, 2)
    assert (found.identity.metadata_mismatches, found.identity.nonfinite_weights) == (0, 0)
    assert unrecorded(found.identity.card) == []
    (mode,), (coverage,) = found.modes, found.coverage
    assert (mode.method, mode.convention, mode.nfe, mode.samples) == ("planted", "euler", 2, 2)
    assert (coverage.steps, coverage.nfe) == (2, 2)


def test_other_settings_that_it_lets_us_choose_are_rows_beside_the_judged_one(answered, policy):
    """One that its server does not know is a row too, and no fault of the candidate."""
    other = sampling_by(policy, SamplerConfig(name="euler", steps=1))
    served = ServedPolicy(policy, samplers={"one": other})
    named = {name: {"sampler": "euler", "sampler_steps": 1} for name in ("one", "unknown")}
    found = answered(served.answer, served.metadata, samplers=named)
    own, one, unknown = found.coverage
    assert [row.steps for row in found.coverage] == [2, 1, 1]
    assert (own.nfe, one.nfe, one.nonfinite) == (2, 1, 0) and one.chunk_error > 0.0
    assert unknown.nonfinite > 0 and np.isnan(unknown.chunk_error)
    assert len({row.sampler_sha256 for row in found.coverage}) == 3
    assert found.failed.faults == {} and {row.nfe for row in found.modes} == {2}


class DiesOf(ServedPolicy):
    """Once it was asked for another setting it answers nothing any more."""

    gone = False

    def answer(self, message):
        self.gone = self.gone or "sampler" in message["genpolicy"]
        if self.gone:
            raise ValueError("gone")
        return super().answer(message)


def test_a_further_setting_that_ends_the_server_costs_nothing_that_is_judged(answered, policy):
    dies = DiesOf(policy, samplers={"one": policy})
    named = {"one": {"sampler": "euler", "sampler_steps": 1}}
    found = answered(dies.answer, dies.metadata, samplers=named)
    assert (found.failed.faults, found.identity.nonfinite_weights) == ({}, 0)
    assert {row.max_abs_difference for row in found.samples} == {0.0}
    own, one = found.coverage
    assert own.nonfinite == 0 and one.nonfinite > 0


def test_what_nobody_declares_is_missing_by_name(answered, policy):
    served = ServedPolicy(policy)
    found = answered(served.answer, served.metadata, declared=None)
    missing = unrecorded(found.identity.card)
    assert {"architecture", "parameters", "training_seeds", "split", "sampler"} <= set(missing)
    assert (found.nfe, found.coverage, found.identity.seed) == ([], [], [])


class Drifts(ServedPolicy):
    """Adds a little with every question, as a policy with a state or a seed of its own does."""

    def __init__(self, policy):
        super().__init__(policy)
        self.count = itertools.count()

    def answer(self, message):
        answer = super().answer(message)
        answer["actions"] = answer["actions"] + 1e-3 * next(self.count)
        return answer


def test_a_state_that_questions_leave_behind_shows_after_the_new_start(answered, policy):
    drifts = Drifts(policy)
    found = answered(drifts.answer, drifts.metadata)
    assert max(row.max_abs_difference for row in found.samples) > 1e-3


class Breaks(ServedPolicy):
    """One of its chunks holds a NaN."""

    def answer(self, message):
        answer = super().answer(message)
        if message["genpolicy"]["noise"][:2] == ["fixture", 5]:
            answer["actions"][0, 3, 1] = np.nan
        return answer


def test_a_number_that_is_none_is_counted_and_nothing_stops(answered, policy):
    breaks = Breaks(policy)
    found = answered(breaks.answer, breaks.metadata)
    assert found.identity.nonfinite_weights == 1
    assert np.isnan(found.samples[5].max_abs_difference)
    assert len(found.modes) == len(found.coverage) == 1


class Refuses(ServedPolicy):
    """Answers no question about a two-mode situation."""

    def answer(self, message):
        if message["genpolicy"]["noise"][0] == "modes":
            raise ValueError("no")
        return super().answer(message)


def test_a_question_without_an_answer_is_a_sample_that_reaches_no_mode(answered, policy):
    refuses = Refuses(policy)
    found = answered(refuses.answer, refuses.metadata)
    (mode,) = found.modes
    assert (mode.samples, mode.admissible, mode.valid, mode.modes_covered) == (2, 0, 0, 0)
    assert mode.far_from_modes == 2
    assert found.identity.nonfinite_weights == 1


def test_a_server_that_does_not_start_costs_this_candidate_and_says_why(
    asking,
    entry_of,  # noqa: F811
    tmp_path,
):
    command = [sys.executable, "-c", "raise SystemExit('no weights here')  # {port}"]
    entry = entry_of(address=None, command=command, declared=DECLARED)
    brought = BroughtPolicy("planted", tmp_path / "planted.yaml", entry, "c" * 64, 0)
    found = ask_brought(brought, asking)
    assert found.identity.nonfinite_weights >= found.failed.asked > 64
    assert found.failed.faults == {"closed": 16, "gone": found.failed.asked - 16}
    assert "no weights here" in found.failed.last_words
    assert np.isnan([row.max_abs_difference for row in found.samples]).all()
    (coverage,) = found.coverage
    assert found.nfe == [] and coverage.nonfinite > 0 and np.isnan(coverage.chunk_error)


def test_other_metadata_after_the_new_start_are_counted(answered, policy, monkeypatch):
    served, true = ServedPolicy(policy), remote.capabilities
    other = {"genpolicy": {**served.metadata["genpolicy"], "candidates": 8}}
    # The first start dials twice, once for what is asked again on a new line; then comes another.
    told = iter([served.metadata] * 2 + [other] * 2)
    monkeypatch.setattr(remote, "capabilities", lambda _: true(next(told)))
    found = answered(served.answer, served.metadata)
    assert found.identity.metadata_mismatches == 1
