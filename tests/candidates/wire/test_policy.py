"""A policy behind the wire in the place of ours: its faults are chunks that are none."""

import sys
from dataclasses import replace

import numpy as np
import pytest

from genpolicy.candidates.brought import BroughtPolicy
from genpolicy.candidates.contenders import joining_of
from genpolicy.candidates.joining import JoiningSettings
from genpolicy.candidates.wire.extension import WORD, Capabilities
from genpolicy.candidates.wire.faults import Fault
from genpolicy.candidates.wire.policy import GONE_AFTER, WirePolicy, running
from genpolicy.candidates.wire.remote import RemotePolicy
from genpolicy.contract.latency import MEASURED_TERMS, OWNERS, Owner, Term
from genpolicy.errors import ConfigError, IntegrityError
from genpolicy.policies.prefix import Prefix
from tests.candidates.conftest import ENTRY
from tests.candidates.wire.test_remote import CAN, Planted


@pytest.fixture
def wire(serving, entry, task, tmp_path):
    """A planted policy in the place of ours, and its server's answering function."""
    opened = []

    def open_line(planted, entry=entry, **clock):
        context = serving(planted, {WORD: planted.can})
        remote = RemotePolicy(
            entry, context.__enter__(), task.observation, scene=task.scene_path, **clock
        )
        opened.append((context, remote))
        brought = BroughtPolicy("planted", tmp_path / "planted.yaml", entry, "c" * 64, 0)
        return WirePolicy(brought, remote, **clock)

    yield open_line
    for context, remote in opened:
        remote.close()
        context.__exit__(None, None, None)


def seen(count, task):
    return np.tile(np.arange(count, dtype=float)[:, None, None], (1, 2, task.observation.dim))


def test_each_observation_is_asked_under_its_own_name(wire, task):
    planted = Planted()
    policy = wire(planted)
    drawn = policy.sample(seen(3, task), noise_names=[("a", 1), ("b",), ("c", 2)], candidates=3)
    assert drawn.actions.shape == (3, 3, 16, 10)
    assert drawn.nfe == 4
    np.testing.assert_array_equal(drawn.actions[:, 0, 0, 0], [0.0, 1.0, 2.0])
    assert [asked[WORD]["noise"][:2] for asked in planted.asked] == [["a", 1], ["b"], ["c", 2]]
    assert (policy.asked, dict(policy.faults)) == (3, {})
    assert (policy.method, policy.guided, policy.prediction_horizon) == ("planted", False, 16)


class Fails(Planted):
    """Refuses every question of some numbers."""

    def __init__(self, *numbers):
        super().__init__()
        self.numbers = numbers

    def __call__(self, message):
        if len(self.asked) in self.numbers:
            self.asked.append(message)
            raise ValueError("no")
        return super().__call__(message)


def test_a_fault_is_a_chunk_of_nan_and_the_next_answer_counts_again(wire, task):
    policy = wire(Fails(1))
    names = [("a", number) for number in range(3)]
    drawn = policy.sample(seen(3, task), noise_names=names, candidates=2).actions
    assert np.isnan(drawn[1]).all()
    assert np.isfinite(drawn[[0, 2]]).all()
    assert dict(policy.faults) == {"refused": 1}


def test_each_row_says_how_it_failed(wire, task):
    policy = wire(Fails(1))
    names = [("a", number) for number in range(3)]
    drawn = policy.sample(seen(3, task), noise_names=names, candidates=2)
    assert drawn.faults == (None, Fault.REFUSED, None)
    assert "no" in policy.last_words


class SendsNone(Planted):
    """Of the chunks of a message the first ones hold a number that is none."""

    def __init__(self, broken):
        super().__init__()
        self.broken = broken

    def __call__(self, message):
        answer = super().__call__(message)
        answer["actions"][: self.broken, 5, 2] = np.nan
        return answer


def test_an_answer_without_one_finite_chunk_is_a_fault_and_one_with_one_is_none(wire, task):
    names = [("a", number) for number in range(GONE_AFTER + 2)]
    policy = wire(SendsNone(3))
    drawn = policy.sample(seen(len(names), task), noise_names=names, candidates=3)
    assert set(drawn.faults) == {Fault.NONFINITE} and np.isnan(drawn.actions).all()
    assert policy.faults == {"nonfinite": len(names)}  # it did answer, and is asked on
    drawn = wire(SendsNone(2)).sample(seen(1, task), noise_names=[("a",)], candidates=3)
    assert drawn.faults == (None,)
    np.testing.assert_array_equal(np.isfinite(drawn.actions[0]).all(axis=(1, 2)), [0, 0, 1])


@pytest.mark.parametrize("command", [
    [sys.executable, "-c", "raise SystemExit('no weights here')  # {port}"],
    [sys.executable, "-c", "import time; time.sleep(60)  # {port}"],
])  # fmt: skip
def test_a_server_that_does_not_start_fails_every_invocation_and_stops_nobody(
    entry_of, task, tmp_path, command
):
    entry = entry_of(address=None, command=command, start_timeout_s=1.0)
    brought = BroughtPolicy("planted", tmp_path / "planted.yaml", entry, "c" * 64, 0)
    with running(brought, task.observation) as policy:
        assert (policy.guided, policy.told) == (False, Capabilities())
        names = [("a", number) for number in range(GONE_AFTER + 1)]
        drawn = policy.sample(seen(len(names), task), noise_names=names, candidates=2)
        assert drawn.actions.shape == (len(names), 2, 16, 10) and np.isnan(drawn.actions).all()
        again = policy.sample(seen(1, task), noise_names=[("a",)], candidates=1, prefix=given(1.0))
        assert again.faults == (Fault.GONE,)  # no setting of ours is to blame
        real_time = JoiningSettings(rule="real_time")
        assert joining_of(real_time, policy) is real_time
        assert drawn.faults[-1] == Fault.GONE and len(set(drawn.faults[:-1])) == 1
        assert ("no weights here" if "raise" in command[2] else "does not listen") in (
            policy.last_words
        )


def test_who_fails_again_and_again_is_asked_no_more(wire, task):
    planted = Fails(*range(100))
    policy = wire(planted)
    names = [("a", number) for number in range(GONE_AFTER + 3)]
    drawn = policy.sample(seen(len(names), task), noise_names=names, candidates=1).actions
    assert np.isnan(drawn).all()
    assert len(planted.asked) == GONE_AFTER
    assert dict(policy.faults) == {"refused": GONE_AFTER, "gone": 3}


def test_faults_that_are_not_in_a_row_do_not_end_it(wire, task):
    policy = wire(Fails(*range(0, 100, 2)))
    names = [("a", number) for number in range(4 * GONE_AFTER)]
    policy.sample(seen(len(names), task), noise_names=names, candidates=1)
    assert dict(policy.faults) == {"refused": 2 * GONE_AFTER}


def test_one_that_always_draws_the_same_is_asked_for_one(wire, task, entry_of):
    planted = Planted()
    policy = wire(planted, entry=entry_of(stochastic=False))
    drawn = policy.sample(seen(1, task), noise_names=[("a",)], candidates=3).actions
    assert drawn.shape == (1, 3, 16, 10)
    assert [asked[WORD]["candidates"] for asked in planted.asked] == [1]
    np.testing.assert_array_equal(drawn[0, 0], drawn[0, 2])


def test_time_that_no_span_explains_is_of_the_sampler(wire, task):
    ticks = iter(np.arange(0.0, 100.0, 2.0))
    policy = wire(Planted(spans=["sample"]), clock=lambda: next(ticks))
    terms, chunks = policy.timed(seen(1, task)[0], noise=("a",), candidates=1)
    assert chunks.shape == (1, 16, 10)
    assert np.isnan([terms[Term.PREPROCESS], terms[Term.ENCODE]]).all()
    # The server says .5 s; by the clock here it took 2 s from first byte to last chunk.
    assert terms[Term.SAMPLE] == 2.0


@pytest.mark.parametrize("term", Term)
def test_time_of_an_answer_is_counted_once_whatever_its_server_states(wire, task, term):
    """Of the model's terms each is its own; what is of others comes on top by both clocks."""
    ticks = iter(np.arange(0.0, 100.0, 2.0))
    planted = Planted(spans=[*dict.fromkeys(["preprocess", "encode", "sample", term])])
    planted.changes = {"spans_s": {**dict.fromkeys(planted.can["spans"], 0.125), term: 0.5}}
    policy = wire(planted, clock=lambda: next(ticks))
    terms, _ = policy.timed(seen(1, task)[0], noise=("a",), candidates=1)
    assert sum(terms.values()) == 2.0
    assert set(terms) <= set(MEASURED_TERMS)  # of the others the cell has its own
    if OWNERS[term] is Owner.MODEL and term is not Term.SAMPLE:
        assert terms[term] == 0.5
    else:
        assert set(terms) == {Term.PREPROCESS, Term.ENCODE, Term.SAMPLE}
        assert terms[Term.SAMPLE] == 1.75


def test_a_server_that_measures_nothing_is_all_sampling(wire, task):
    ticks = iter(np.arange(0.0, 100.0, 2.0))
    policy = wire(Planted(spans=[]), clock=lambda: next(ticks))
    terms, _ = policy.timed(seen(1, task)[0], noise=("a",), candidates=1)
    assert terms[Term.SAMPLE] == 2.0


def test_a_fault_took_as_long_as_it_was_waited_for(wire, task):
    ticks = iter(np.arange(0.0, 1000.0, 2.0))
    policy = wire(Fails(0), clock=lambda: next(ticks))
    terms, chunks = policy.timed(seen(1, task)[0], noise=("a",), candidates=1)
    assert np.isnan(chunks).all() and np.isnan(terms[Term.ENCODE])
    assert terms[Term.SAMPLE] >= 2.0


def given(*weights):
    """One action from which a chunk goes on for as many rows as there are weights."""
    actions = np.zeros((1, 16, 10))
    actions[..., [3, 7]] = 1.0
    actions[0, : len(weights), 0] = np.arange(1, len(weights) + 1)
    actions[0, len(weights) :] = 0.0
    return Prefix(actions, np.array([[*weights, *[0.0] * (16 - len(weights))]]), 5.0)


def test_no_server_without_the_word_is_asked_to_go_on_from_a_prefix(wire, task):
    with pytest.raises(ConfigError, match=r"prefix for planted.*takes no prefix"):
        wire(Planted()).sample(seen(1, task), noise_names=[("a",)], candidates=1, prefix=given(1.0))


def test_a_prefix_goes_over_the_wire_with_its_weights(wire, task):
    planted = Planted(prefix=True)
    policy = wire(planted)
    assert policy.guided
    policy.sample(seen(1, task), noise_names=[("a",)], candidates=2, prefix=given(1.0, 1.0, 0.25))
    said = planted.asked[0][WORD]["prefix"]
    assert (said["frozen"], said["bound"]) == (2, 5.0)
    np.testing.assert_array_equal(said["weights"], [1.0, 1.0, 0.25, *[0.0] * 13])
    # Behind the last weight the last given action stands: a pose, in whatever form.
    np.testing.assert_array_equal(said["actions"][:, 0], [1.0, 2.0, 3.0, *[3.0] * 13])


def test_the_rule_that_draws_on_is_of_who_takes_a_prefix(wire):
    real_time = JoiningSettings(rule="real_time")
    assert joining_of(real_time, wire(Planted(prefix=True))) is real_time
    with pytest.raises(ConfigError, match="planted"):
        joining_of(real_time, wire(Planted()))
    exempt = JoiningSettings(rule="real_time", exempt=["planted"])
    assert joining_of(exempt, wire(Planted())).rule == "replace"


def test_nobody_over_a_wire_is_told_where_to_start(wire, task):
    warm = JoiningSettings(rule="warm_start")
    with pytest.raises(ConfigError, match=r"planted.*no path from noise to start on"):
        joining_of(warm, wire(Planted(prefix=True)))
    exempt = warm.model_copy(update={"exempt": ["planted"]})
    assert joining_of(exempt, wire(Planted(prefix=True))).rule == "replace"
    prefix = replace(given(1.0), strength=0.5)
    with pytest.raises(ConfigError, match=r"prefix for planted.*nothing to start from"):
        wire(Planted(prefix=True)).sample(
            seen(1, task), noise_names=[("a",)], candidates=1, prefix=prefix
        )


def test_what_nothing_is_given_to_is_asked_plainly(wire, task):
    planted = Planted(prefix=True)
    names = [("a",), ("b",)]
    prefix = Prefix(
        np.concatenate([given().actions, given(1.0).actions]),
        np.concatenate([given().weights, given(1.0).weights]), 5.0,
    )  # fmt: skip
    wire(planted).sample(seen(2, task), noise_names=names, candidates=1, prefix=prefix)
    assert ["prefix" in asked[WORD] for asked in planted.asked] == [False, True]


@pytest.mark.parametrize(("changes", "told"), [
    ({"position": None, "rotation": None, "frame": None,
      "joints": {"columns": list(range(7)), "unit": "rad"}}, "joints"),
    ({"rotation": None, "motion": "relative",
      "anchor": {"position": ["tcp_position_m"], "rotation": ["tcp_rotation"]}}, "no rotation"),
])  # fmt: skip
def test_a_form_in_which_given_actions_cannot_be_said_is_no_guided_one(
    wire, task, entry_of, changes, told
):
    entry = entry_of(action={**ENTRY["action"], **changes})
    policy = wire(Planted(prefix=True), entry=entry)
    assert not policy.guided
    with pytest.raises(ConfigError, match=told):
        policy.sample(seen(1, task), noise_names=[("a",)], candidates=1, prefix=given(1.0))


def test_files_are_held_against_their_hashes_each_time_it_starts(entry_of, task, tmp_path):
    entry = entry_of(files={"weights.bin": "0" * 64})
    (tmp_path / "weights.bin").write_bytes(b"others")
    brought = BroughtPolicy("planted", tmp_path / "planted.yaml", entry, "c" * 64, 0)
    with pytest.raises(IntegrityError, match="planted"), running(brought, task.observation):
        pytest.fail("it ran")


def test_it_speaks_the_capabilities_of_its_server(wire):
    assert wire(Planted()).told.checkpoint == CAN["checkpoint"]
