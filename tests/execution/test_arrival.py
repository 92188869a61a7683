"""What may enter the queue: each reason for refusing an arrival, in pairs."""

from dataclasses import replace

import numpy as np
import pytest
from playing import begin, judged

from genpolicy.contract.chunk import DiscardReason
from genpolicy.evidence.shadow.rig import (
    ROWS,
    Rig,
    StandInVerdict,
    passing_verdict,
)
from genpolicy.execution.arrival import LAYER_COUNT
from genpolicy.execution.executor import Executor

R = DiscardReason


AT_ARRIVAL = {
    R.EXPIRED: lambda rig: {"valid_until_s": rig.now_s - 0.001},
    R.STALE_OBSERVATION: lambda rig: {"condition_observation_event_time_s": rig.now_s - 0.601},
    R.FUTURE_OBSERVATION: lambda rig: {"condition_observation_event_time_s": rig.now_s + 0.001},
    R.PHASE_TRANSITION: lambda rig: {"task_phase": "insert"},
    R.CALIBRATION_MISMATCH: lambda rig: {"calibration_epoch": "epoch-2"},
    R.CHECKPOINT_MISMATCH: lambda rig: {"policy_checkpoint_hash": "0" * 64},
    R.SAMPLER_MISMATCH: lambda rig: {"sampler_config_hash": "0" * 64},
    R.BROKEN_PREDECESSOR: lambda rig: {"predecessor_chunk_id": "ghost"},
    R.RESET: lambda rig: {"session_epoch": 7},
    R.INFEASIBLE: lambda rig: {"actions_sha256": "0" * 64},
}


@pytest.mark.parametrize("reason", AT_ARRIVAL, ids=str)
def test_pair_of_each_reason_at_arrival(reason):
    good, bad = Rig(), Rig()
    for rig in (good, bad):
        rig.advance(1.0)
        rig.observe()
    assert good.deliver(good.chunk()) is None
    assert good.tick()[0].kind == "action"
    assert bad.deliver(bad.chunk(**AT_ARRIVAL[reason](bad))) is reason
    assert bad.tick()[0].kind == "hold"
    assert bad.executor.conservation().chunks.discarded == {str(reason): 1}
    assert bad.stub.arrivals == 0
    judged(good)
    judged(bad)


WITHIN_LIMIT = {
    R.EXPIRED: lambda rig: {"valid_until_s": rig.now_s},
    R.STALE_OBSERVATION: lambda rig: {"condition_observation_event_time_s": rig.now_s - 0.6},
    R.FUTURE_OBSERVATION: lambda rig: {"condition_observation_event_time_s": rig.now_s},
}


@pytest.mark.parametrize("reason", WITHIN_LIMIT, ids=str)
def test_exactly_at_the_limit_is_accepted(reason):
    rig = Rig()
    rig.advance(1.0)
    rig.observe()
    assert rig.deliver(rig.chunk(**WITHIN_LIMIT[reason](rig))) is None
    assert rig.tick()[0].kind == "action"
    judged(rig)


@pytest.mark.parametrize("ticks, reason", [(0, R.OUT_OF_ORDER), (1, R.SUPERSEDED)])
def test_an_older_observation_behind_a_newer_one(ticks, reason):
    rig = Rig()
    begin(rig)
    rig.observe()
    rig.executor.force_event(rig.now_s)  # the first chunk is gone; only the newer one remains
    rig.observe()
    rig.deliver(rig.chunk(predecessor_chunk_id=""))
    rig.tick(ticks)
    chunk = rig.chunk(condition_observation_event_time_s=rig.now_s - 0.05 * ticks,
                      action_start_time_s=0.06, predecessor_chunk_id="")  # fmt: skip
    assert rig.deliver(chunk) is reason
    judged(rig)


def test_a_duplicate_has_no_effect():
    once, twice = Rig(), Rig()
    for rig in (once, twice):
        rig.observe()
        chunk = rig.chunk()
        assert rig.deliver(chunk) is None
        if rig is twice:
            assert rig.deliver(chunk) is R.DUPLICATE
        rig.tick(3)
        if rig is twice:
            assert rig.deliver(chunk) is R.DUPLICATE
        rig.tick(6)
    kinds = [
        [e.payload for e in rig.journal.events() if e.kind == "accept"] for rig in (once, twice)
    ]
    assert kinds[0] == kinds[1]
    judged(twice)


def test_after_the_end_everything_is_refused():
    rig = Rig()
    rig.observe()
    rig.executor.end_episode(0.0)
    assert rig.deliver(rig.chunk()) is R.END_OF_EPISODE
    assert rig.executor.tick(0.0).kind == "hold"


def test_a_rejected_or_lost_chunk_is_written_off_once():
    rig = Rig()
    rig.observe()
    chunk = rig.chunk()
    rig.executor.write_off(chunk.metadata, 16, R.INFEASIBLE, 0.0)
    rig.executor.write_off(chunk.metadata, 16, R.EXPIRED, 0.0)
    assert rig.deliver(chunk) is R.DUPLICATE
    assert rig.executor.conservation().chunks.discarded == {"infeasible": 1, "duplicate": 2}
    judged(rig)


def test_only_what_feasibility_issued_is_taken_by_default():
    rig = Rig()
    strict = Executor(rig.cell, rig.journal, rig.stub)
    rig.begin(strict)
    strict.observe(0.0, 0.0, "approach", "epoch-1")
    assert strict.deliver(rig.chunk(), 0.0) is R.INFEASIBLE
    assert strict.tick(0.0).kind == "hold"


def test_force_event_needs_an_observation_from_after_it():
    rig = Rig()
    begin(rig)
    rig.observe()
    before = rig.chunk(predecessor_chunk_id="")
    rig.advance(0.01)
    rig.executor.force_event(rig.now_s)
    assert rig.deliver(replace(before)) is R.FORCE_EVENT
    rig.observe()
    assert rig.deliver(rig.chunk()) is None
    judged(rig)


@pytest.mark.parametrize("thing", [None, 1, "x", object(), np.zeros((16, 10))])
def test_anything_else_is_refused_without_a_fault(thing):
    rig = Rig()
    rig.observe()
    assert rig.deliver(thing) is R.INFEASIBLE
    assert rig.executor.conservation().error == 0


@pytest.mark.parametrize("actions", [
    np.full((16, 10), np.nan), np.full((16, 10), np.inf), np.zeros((16, 9)), np.zeros((0, 10)),
])  # fmt: skip
def test_broken_actions_are_refused_though_their_hash_is_right(actions):
    rig = Rig()
    rig.observe()
    assert rig.deliver(rig.chunk(actions=actions)) is R.INFEASIBLE
    judged(rig)


def _refused_for_its_layers(layers):
    rig = Rig()
    rig.observe()
    assert rig.deliver(rig.chunk(verdict=StandInVerdict(tuple(layers), (0, ROWS)))) is R.INFEASIBLE
    judged(rig)


@pytest.mark.parametrize("layer", range(LAYER_COUNT))
@pytest.mark.parametrize("passed", [False, None, 1, "unknown", np.nan])
def test_a_layer_that_does_not_say_that_it_passed_did_not(layer, passed):
    layers = list(passing_verdict().layers)
    layers[layer] = replace(layers[layer], passed=passed)
    _refused_for_its_layers(layers)


def test_layers_that_passed_are_six_and_no_other_number():
    layers = passing_verdict().layers
    for wrong in ((), layers[:-1], layers[1:], (*layers, layers[0])):
        _refused_for_its_layers(wrong)


def test_a_chunk_that_feasibility_issued_is_taken_and_a_tampered_one_is_not():
    from genpolicy.contract.chunk import Projected, Proposal
    from genpolicy.feasibility import admission
    from genpolicy.feasibility.settings import LAYERS
    from genpolicy.feasibility.verdict import LayerOutcome, LayerVerdict, Verdict

    rig = Rig()
    strict = Executor(rig.cell, rig.journal, rig.stub)
    rig.begin(strict)
    strict.observe(0.0, 0.0, "approach", "epoch-1", tcp_m=rig.tcp_m)

    def issued():
        made = rig.chunk()
        layers = tuple(
            LayerVerdict(name, LayerOutcome.PASSED, None, 1.0, None, None) for name in LAYERS
        )
        projected = Projected(Proposal(made.metadata, made.actions, "first"), made.actions, 0, 0)
        return admission.Admitted(
            projected=projected, verdict=Verdict(layers, {}, (0, 16)), context=rig.context(),
            seal=admission._SEAL,
        )  # fmt: skip

    good, bad = issued(), issued()
    forged = object.__new__(admission.Admitted)  # behind the seal's back, all else in order
    for name in ("projected", "actions_sha256", "verdict", "context"):
        object.__setattr__(forged, name, getattr(good, name))
    assert strict.deliver(forged, 0.0) is R.INFEASIBLE  # and does not use up the name of `good`
    bad.projected.actions.flags.writeable = True
    bad.projected.actions[0, 0] += 1e-9
    assert strict.deliver(bad, 0.0) is R.INFEASIBLE
    assert strict.deliver(good, 0.0) is None
    assert strict.tick(0.0).kind == "action"
    good.projected.actions.flags.writeable = True
    good.projected.actions[1, 0] += 1e-9  # changed after admission: the stub sees it
    command = strict.tick(0.05)
    assert command.kind == "hold" and command.reason == "refused: infeasible"
    assert rig.stub.invalid == 1


def test_a_chunk_may_not_rest_on_an_observation_that_was_never_heard():
    blind = Rig()
    blank = {"task_phase": "", "calibration_epoch": ""}
    assert blind.deliver(blind.chunk(**blank)) is R.FUTURE_OBSERVATION
    rig = Rig()
    rig.observe()
    rig.advance(0.1)
    assert rig.deliver(rig.chunk()) is R.FUTURE_OBSERVATION  # claims 0.1 s; heard was 0 s
    judged(rig)


def test_a_chunk_whose_last_window_has_just_closed_is_expired_on_arrival():
    for late_s, reason in ((0.399, None), (0.4, R.EXPIRED)):
        rig = Rig()
        rig.observe()
        chunk = rig.chunk()
        rig.advance(late_s)
        assert rig.deliver(chunk) is reason
        judged(rig)


@pytest.mark.parametrize("name, there, reason", [
    ("phase", "insert", R.PHASE_TRANSITION), ("epoch", "epoch-2", R.CALIBRATION_MISMATCH),
])  # fmt: skip
def test_going_there_and_back_does_not_revive_an_old_chunk(name, there, reason):
    rig = Rig()
    rig.observe()
    old = rig.chunk()
    home = getattr(rig, name)
    for value in (there, home):
        rig.advance(0.02)
        setattr(rig, name, value)
        rig.observe()
    assert rig.deliver(old) is reason
    judged(rig)
