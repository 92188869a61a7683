"""The executor in pairs: what is in order passes, what is not is discarded for its own reason."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from genpolicy.contract.chunk import DiscardReason
from genpolicy.errors import ConfigError, NonFiniteError
from genpolicy.evidence.shadow.rig import CHECKPOINT, SAMPLER, SETTINGS, Rig, passing_verdict
from genpolicy.execution.executor import Executor
from genpolicy.execution.ledger import Account, Conservation
from genpolicy.execution.nanoseconds import to_ns
from genpolicy.verification.checker import check_messages

R = DiscardReason


def judged(rig):
    events = rig.end()
    report = check_messages(
        (e.kind, {"session": e.session, "n": e.n, "t": e.t, **e.payload}) for e in events
    )
    assert report.violations == []
    assert rig.executor.conservation().error == 0
    assert rig.stub.stale == rig.stub.invalid == 0  # the executor saw it first
    return report


def older(rig):
    return {"condition_observation_event_time_s": 0.0, "action_start_time_s": 0.0,
            "predecessor_chunk_id": ""}  # fmt: skip


def begin(rig, ticks=2):
    rig.observe()
    rig.deliver(rig.chunk())
    rig.tick(ticks)


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


def change(**values):
    def apply(rig):
        for name, value in values.items():
            setattr(rig, name, value)
        rig.observe()

    return apply


EVENTS = {
    R.PHASE_TRANSITION: change(phase="insert"),
    R.CALIBRATION_MISMATCH: change(epoch="epoch-2"),
    R.FORCE_EVENT: lambda rig: rig.executor.force_event(rig.now_s),
    R.COLLISION_EVENT: lambda rig: rig.executor.collision_event(rig.now_s),
    R.OBSERVATION_DIVERGENCE: lambda rig: rig.observe(divergence_m=0.051),
    R.RESET: lambda rig: rig.executor.reset(rig.now_s),
    R.INTERVENTION: lambda rig: rig.executor.intervene(rig.now_s),
    R.STOPPED: lambda rig: rig.supervisor.emergency_stop(rig.now_s),
    R.CHECKPOINT_MISMATCH: lambda rig: rig.executor.set_active(rig.now_s, "0" * 64, SAMPLER),
    R.SAMPLER_MISMATCH: lambda rig: rig.executor.set_active(rig.now_s, CHECKPOINT, "0" * 64),
    R.END_OF_EPISODE: lambda rig: None,
    R.SUPERSEDED: lambda rig: (rig.observe(), rig.deliver(rig.chunk())),
}


@pytest.mark.parametrize("reason", EVENTS, ids=str)
def test_pair_of_each_event_that_discards_the_queued_rest(reason):
    calm, eventful = Rig(), Rig()
    begin(calm)
    assert calm.tick()[0].kind == "action"
    begin(eventful)
    EVENTS[reason](eventful)
    command = eventful.tick()[0]
    if reason not in (R.SUPERSEDED, R.END_OF_EPISODE):
        assert command.kind in ("hold", "stop")
    judged(eventful)
    balance = eventful.executor.conservation()
    assert balance.rest_discarded.get(str(reason)) == 1
    assert balance.actions.discarded[str(reason)] >= 5


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


def test_a_full_queue_drops_its_oldest_chunk_and_does_not_block():
    rig = Rig(settings=replace(SETTINGS, queue_capacity=1))
    rig.observe()
    rig.deliver(rig.chunk(action_start_time_s=0.2))
    assert rig.deliver(rig.chunk(action_start_time_s=0.4)) is None
    assert rig.executor.conservation().chunks.discarded == {"queue_overflow": 1}
    judged(rig)


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
    strict = Executor(SETTINGS, rig.journal, rig.stub)
    strict.set_active(0.0, CHECKPOINT, SAMPLER)
    strict.observe(0.0, 0.0, "approach", "epoch-1")
    assert strict.deliver(rig.chunk(), 0.0) is R.INFEASIBLE
    assert strict.tick(0.0).kind == "hold"


def test_rows_are_due_in_their_half_open_window():
    """Worked by hand: start 0.10 s, period 0.05 s, so row j is due in [0.10 + 0.05 j, +0.05)."""
    due = {0.0999: None, 0.10: 0, 0.1499: 0, 0.15: 1, 0.449999: 6, 0.45: 7, 0.499: 7, 0.50: None}
    for time_s, row in due.items():
        rig = Rig()
        rig.observe()
        assert rig.deliver(rig.chunk(action_start_time_s=0.10)) is None
        command = rig.executor.tick(time_s)
        assert command.action_index == (-1 if row is None else row), time_s
        if row is not None:
            assert np.array_equal(command.action, rig.actions(1)[row])


def test_float_ticks_hit_every_row_exactly_once():
    rig = Rig()
    rows = []
    for n in range(8 * 300):
        now_s = n * 0.05  # not a multiple of 0.05 for most n
        if n % 8 == 0:
            rig.now_ns = to_ns(now_s)
            rig.executor.observe(now_s, now_s, "approach", "epoch-1")
            assert rig.executor.deliver(rig.chunk(
                action_start_time_s=now_s, condition_observation_event_time_s=now_s,
            ), now_s) is None  # fmt: skip
        rows.append(rig.executor.tick(now_s).action_index)
    assert rows == list(range(8)) * 300
    assert rig.executor.conservation().actions.discarded == {"beyond_execution_horizon": 8 * 300}


def test_a_late_chunk_skips_the_rows_whose_time_has_passed():
    rig = Rig()
    rig.observe()
    chunk = rig.chunk()
    rig.advance(0.15)
    assert rig.deliver(chunk) is None
    assert [c.action_index for c in rig.tick(6)] == [3, 4, 5, 6, 7, -1]
    assert rig.executor.conservation().actions.discarded["late"] == 3
    judged(rig)


def test_two_ticks_in_one_window_send_one_action():
    rig = Rig()
    rig.observe()
    rig.deliver(rig.chunk())
    kinds = [rig.executor.tick(t).kind for t in (0.0, 0.01, 0.049, 0.05)]
    assert kinds == ["action", "hold", "hold", "action"]


def test_a_prefetched_chunk_takes_over_at_its_start():
    rig = Rig()
    rig.observe()
    rig.deliver(rig.chunk())
    first = rig.tick(1)
    rig.observe()
    assert rig.deliver(rig.chunk(action_start_time_s=0.15)) is None
    rest = rig.tick(4)
    assert [c.chunk_id for c in first + rest] == ["chunk-1"] * 3 + ["chunk-2"] * 2
    assert [c.action_index for c in first + rest] == [0, 1, 2, 0, 1]
    judged(rig)


def test_the_chain_continues_or_begins_anew():
    rig = Rig()
    begin(rig)
    rig.observe()
    assert rig.executor.chain_head == "chunk-1"
    assert rig.deliver(rig.chunk(predecessor_chunk_id="chunk-1")) is None
    assert rig.deliver(rig.chunk(predecessor_chunk_id="chunk-1")) is R.BROKEN_PREDECESSOR
    rig.executor.force_event(rig.now_s)
    assert rig.executor.chain_head == ""
    rig.observe()
    assert rig.deliver(rig.chunk(predecessor_chunk_id="chunk-2")) is R.BROKEN_PREDECESSOR
    assert rig.deliver(rig.chunk(predecessor_chunk_id="")) is None
    judged(rig)


def test_an_older_observation_is_ignored_and_counted():
    rig = Rig()
    rig.advance(0.5)
    assert rig.observe() is True
    rig.phase = "insert"
    assert rig.observe(age_s=0.1) is False  # its phase is not believed either
    assert rig.observe(age_s=-0.1) is False
    assert rig.executor.observe(rig.now_s, math.nan, "insert", "epoch-1") is False
    assert rig.executor.observations_ignored == 3
    assert Rig().executor.observe(0.0, math.nan, "insert", "epoch-1") is False
    rig.phase = "approach"
    assert rig.deliver(rig.chunk()) is None
    judged(rig)


def test_a_pause_of_300_ms_rejects_the_stale_rest_first():
    settings_short = replace(SETTINGS, maximum_age_s={"approach": 0.25, "insert": 0.25})
    rig = Rig(settings=settings_short)
    begin(rig, ticks=1)
    rig.advance(0.3)  # the executor sleeps; the controller's own clock goes on
    command = rig.tick()[0]
    assert command.kind == "hold"
    events = rig.journal.events()
    stale = next(e for e in events if e.kind == "discard")
    woke = next(e for e in events if e.kind == "hold" and e.payload["reason"] == "empty")
    assert stale.payload["reason"] == "stale_observation" and stale.n < woke.n
    watchdog = next(e for e in events if e.kind == "hold")
    assert watchdog.payload["reason"] == "watchdog"
    assert watchdog.t <= to_ns(0.05 + 0.1)  # P2: period + watchdog after the action at 0 s
    judged(rig)


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


def test_intervention_until_handback_and_observations_after_it():
    rig = Rig()
    begin(rig)
    rig.executor.intervene(rig.now_s)
    rig.observe()
    assert rig.deliver(rig.chunk()) is R.INTERVENTION
    during = rig.chunk()
    rig.advance(0.02)
    rig.executor.hand_back(rig.now_s)
    assert rig.deliver(during) is R.INTERVENTION
    rig.observe()
    assert rig.deliver(rig.chunk()) is None
    judged(rig)


def test_fallback_commands_only_in_its_mode_and_is_tagged():
    rig = Rig()
    rig.observe()
    mark = {"policy_checkpoint_hash": SETTINGS.fallback_hash,
            "sampler_config_hash": SETTINGS.fallback_hash}  # fmt: skip
    assert rig.executor.deliver_fallback(rig.chunk(**mark), 0.0) is R.STOPPED
    assert rig.deliver(rig.chunk(**mark)) is R.CHECKPOINT_MISMATCH
    rig.executor.begin_fallback(0.0)
    assert rig.deliver(rig.chunk()) is R.STOPPED
    assert rig.executor.deliver_fallback(rig.chunk(**mark), 0.0) is None
    assert [c.kind for c in rig.tick(3)] == ["fallback"] * 3
    rig.executor.end_fallback(rig.now_s)
    assert rig.tick()[0].kind == "hold"
    rig.observe()
    assert rig.deliver(rig.chunk()) is None
    assert judged(rig).checked_fallback_actions == 3


def test_needs_invocation_by_remaining_actions_and_flight():
    rig = Rig()
    assert rig.executor.needs_invocation(0.0)
    rig.executor.begin_invocation(0.0, "i-1")
    assert not rig.executor.needs_invocation(0.0)
    rig.executor.end_invocation(0.0, "i-1", "answered")
    rig.observe()
    rig.deliver(rig.chunk())
    needs = [rig.executor.needs_invocation(rig.now_s)]
    for _ in range(8):
        rig.tick()
        needs.append(rig.executor.needs_invocation(rig.now_s))
    assert needs == [False] * 5 + [True] * 4  # 8, 7, 6, 5, 4 left, then 3, 2, 1, 0
    rig.supervisor.emergency_stop(rig.now_s)
    assert not rig.executor.needs_invocation(rig.now_s)


def test_actions_are_read_only_and_bitwise_those_admitted():
    rig = Rig()
    rig.observe()
    chunk = rig.chunk()
    rig.deliver(chunk)
    command = rig.executor.tick(0.0)
    assert command.action.tobytes() == chunk.actions[0].tobytes()
    with pytest.raises(ValueError, match="read-only"):
        command.action[0] = 1.0


def test_only_checked_rows_are_executed():
    rig = Rig()
    rig.observe()
    rig.deliver(rig.chunk(verdict=passing_verdict(rows=(1, 4))))
    assert [c.action_index for c in rig.tick(5)] == [-1, 1, 2, 3, -1]
    assert rig.executor.conservation().actions.discarded["infeasible"] == 4
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


SHRINK = {
    "maximum_age_s": lambda s, f: replace(s, maximum_age_s={"approach": 0.6 * f}),
    "execution_horizon": lambda s, f: replace(s, execution_horizon=max(1, int(8 * f))),
}


@given(
    name=st.sampled_from(sorted(SHRINK)),
    factor=st.floats(0.0, 1.0),
    age_s=st.floats(0.0, 0.8),
    validity_s=st.floats(0.0, 0.6),
    late_s=st.floats(0.0, 0.5),
)
@settings(max_examples=80, deadline=None, derandomize=True)
def test_tighter_limits_never_accept_more(name, factor, age_s, validity_s, late_s):
    accepted = []
    for limits in (SETTINGS, SHRINK[name](SETTINGS, factor)):
        rig = Rig(settings=limits)
        rig.advance(1.0)
        rig.observe()
        chunk = rig.chunk(
            condition_observation_event_time_s=rig.now_s - age_s,
            valid_until_s=rig.now_s + validity_s,
        )
        rig.advance(late_s)
        rig.deliver(chunk)
        rows = {c.action_index for c in rig.tick(10)} - {-1}
        accepted.append(rows)
        judged(rig)
    assert accepted[1] <= accepted[0]


@given(order=st.permutations(range(6)), ticks=st.lists(st.integers(0, 3), min_size=6, max_size=6))
@settings(max_examples=60, deadline=None, derandomize=True)
def test_order_of_delivery_only_ever_loses_actions(order, ticks):
    """P5: whatever the order, what is executed is proved action by action."""
    rig = Rig()
    chunks = []
    for _ in range(6):
        rig.observe()
        chunks.append(rig.chunk(predecessor_chunk_id=""))
        rig.advance(0.05)
    for index, count in zip(order, ticks, strict=True):
        rig.deliver(chunks[index])
        rig.tick(count)
    judged(rig)


def test_same_calls_same_journal():
    def play():
        rig = Rig()
        for _ in range(3):
            rig.run()
        return rig.end()

    assert play() == play()


@pytest.mark.parametrize("values", [
    {"execution_horizon": 0}, {"action_period_s": 0.0}, {"action_period_s": math.nan},
    {"watchdog_s": 0.01}, {"watchdog_s": math.inf}, {"queue_capacity": 0},
    {"replan_lead_steps": -1}, {"maximum_age_s": {"approach": math.nan}},
    {"maximum_divergence_m": math.nan}, {"fallback_hash": ""},
])  # fmt: skip
def test_settings_are_checked(values):
    with pytest.raises(ConfigError, match="executor setting"):
        replace(SETTINGS, **values)


def test_a_time_that_is_no_time_is_a_fault():
    with pytest.raises(NonFiniteError, match="finite"):
        Rig().executor.tick(math.nan)


def test_a_chunk_that_feasibility_issued_is_taken_and_a_tampered_one_is_not():
    from genpolicy.contract.chunk import Projected, Proposal
    from genpolicy.feasibility import admission
    from genpolicy.feasibility.settings import LAYERS
    from genpolicy.feasibility.verdict import LayerVerdict, Verdict

    rig = Rig()
    strict = Executor(SETTINGS, rig.journal, rig.stub)
    strict.set_active(0.0, CHECKPOINT, SAMPLER)
    strict.observe(0.0, 0.0, "approach", "epoch-1")

    def issued():
        made = rig.chunk()
        layers = tuple(LayerVerdict(name, True, "", 1.0, "any") for name in LAYERS)
        projected = Projected(Proposal(made.metadata, made.actions, "first"), made.actions, 0, 0)
        return admission.Admitted(
            projected=projected, verdict=Verdict(layers, {}, (0, 16)), admitted_at_s=0.0,
            seal=admission._SEAL,
        )  # fmt: skip

    forged = object.__new__(admission.Admitted)  # behind the seal's back, all else in order
    for name in ("projected", "actions_sha256", "verdict", "admitted_at_s"):
        object.__setattr__(forged, name, getattr(issued(), name))
    assert strict.deliver(forged, 0.0) is R.INFEASIBLE
    good, bad = issued(), issued()
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


def test_naming_the_active_weights_again_changes_nothing():
    rig = Rig()
    begin(rig)
    rig.executor.set_active(rig.now_s, CHECKPOINT, SAMPLER)
    assert rig.tick()[0].kind == "action"
    judged(rig)


def test_a_chunk_that_ran_out_may_be_continued():
    rig = Rig()
    begin(rig, ticks=9)
    rig.observe()
    assert rig.executor.chain_head == "chunk-1"
    assert rig.deliver(rig.chunk(predecessor_chunk_id="chunk-1")) is None
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


def test_after_the_fallback_only_observations_from_then_on_count():
    rig = Rig()
    rig.executor.begin_fallback(0.0)
    rig.observe()
    during = rig.chunk()
    rig.advance(0.02)
    rig.executor.end_fallback(rig.now_s)
    assert rig.deliver(during) is R.STOPPED
    judged(rig)


def test_a_reset_does_not_reopen_an_ended_episode():
    rig = Rig()
    rig.executor.end_episode(0.0)
    rig.executor.reset(0.0)
    assert rig.executor.mode == "ended"


def test_an_error_of_either_balance_is_an_error():
    closed = Account(3, 1, {"expired": 1}, 1)
    lost, double = Account(3, 1, {}, 1), Account(3, 2, {"expired": 1}, 1)
    assert (closed.error, lost.error, double.error) == (0, 1, -1)
    assert Conservation(lost, double, {}).error == 2
    assert Conservation(closed, closed, {}).error == 0


def test_an_action_due_no_later_than_the_last_one_waits():
    rig = Rig()
    begin(rig)
    rig.tick()  # row 2, due at 0.1 s
    rig.now_ns = 120_000_000
    rig.observe()
    assert rig.deliver(rig.chunk(action_start_time_s=0.1)) is None
    assert rig.executor.tick(0.12).kind == "hold"
    assert rig.executor.tick(0.15).action_index == 1
    judged(rig)


def test_after_a_reset_an_observation_from_before_it_carries_nothing():
    rig = Rig()
    rig.observe()
    rig.executor.begin_invocation(0.0, "i-1")
    rig.executor.intervene(0.0)
    rig.advance(0.1)
    rig.executor.reset(rig.now_s)
    assert rig.executor.mode == "run" and rig.executor.needs_invocation(rig.now_s)
    assert rig.observe(age_s=0.05) is True
    late = {"condition_observation_event_time_s": rig.now_s - 0.05}
    assert rig.deliver(rig.chunk(**late)) is R.RESET
    rig.observe()
    assert rig.deliver(rig.chunk()) is None
    judged(rig)


def test_divergence_at_the_limit_is_within_it():
    rig = Rig()
    begin(rig)
    rig.observe(divergence_m=0.05)
    assert rig.tick()[0].kind == "action"
    rig.observe(divergence_m=math.nan)
    assert rig.tick()[0].kind == "hold"
    judged(rig)


def test_an_older_chunk_that_ends_does_not_break_the_chain_of_the_newer():
    rig = Rig()
    rig.observe()
    rig.deliver(rig.chunk(valid_until_s=0.06))
    rig.deliver(rig.chunk(action_start_time_s=0.2))
    rig.tick(3)  # the first chunk expires at 0.1 s
    assert rig.executor.chain_head == "chunk-2"
    judged(rig)


def test_events_are_noted_with_what_happened():
    rig = Rig()
    rig.observe()
    rig.executor.begin_invocation(0.0, "i-1")
    rig.executor.end_invocation(0.0, "i-1", "answered")
    rig.deliver(rig.chunk())
    rig.tick(8)
    assert rig.executor.conservation().chunks.queued == 0  # ended with its last action
    rig.now_ns += 200_000_000  # nobody polls
    rig.tick()
    rig.phase, rig.epoch = "insert", "epoch-2"
    rig.observe()
    rig.deliver(rig.chunk())
    rig.tick()
    rig.supervisor.emergency_stop(rig.now_s)
    rig.tick()
    seen = [(e.kind, e.payload) for e in rig.end()]
    stages = [p["stage"] for kind, p in seen if kind == "invocation"]
    changes = [(kind, p["old"], p["new"]) for kind, p in seen if kind in ("phase", "epoch")]
    holds = [p["reason"] for kind, p in seen if kind == "hold"]
    supervised = [p["event"] for kind, p in seen if kind == "supervisor"]
    assert stages == ["begin", "end"]
    assert changes == [("phase", "", "approach"), ("epoch", "", "epoch-1"),
                       ("phase", "approach", "insert"), ("epoch", "epoch-1", "epoch-2"),
                       ]  # fmt: skip
    assert holds == ["watchdog", "empty", "stopped"]
    assert supervised == ["watchdog", "watchdog_recovered", "emergency_stop"]


def test_clock_faults_are_counted():
    rig = Rig()
    rig.advance(1.0)
    rig.tick()
    for n in range(3):
        assert rig.executor.tick(0.5).reason == "clock_backwards"
        assert rig.executor.clock_faults == n + 1
