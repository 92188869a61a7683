"""Recovery by phase: every transition journaled, failures bounded, a stop from everywhere."""

import math
import sys

import numpy as np
import pytest

from genpolicy.errors import ContractError
from genpolicy.evidence.shadow.rig import EXECUTION, Rig, rig_cell
from genpolicy.execution.journal import Journal, write_journal
from genpolicy.execution.recovery import (
    Primitive,
    Recovery,
    RecoveryState,
    fallback_metadata,
    step,
)
from genpolicy.verification.checker import check_messages

S = RecoveryState


@pytest.fixture
def recovery():
    return Recovery(EXECUTION, Journal("r"))


def path(recovery):
    events = [e.payload for e in recovery._journal.events() if e.kind == "recovery"]
    return [event["new"] for event in events]


def test_insert_holds_retreats_returns_and_hands_back(recovery):
    recovery.trigger(0.0, "insert", "jammed")
    assert recovery.advance(0.1) is S.HOLD
    assert recovery.advance(0.2) is S.RETREAT
    recovery.primitive_succeeded(1.0)
    assert recovery.state is S.CLASSICAL_RETURN
    recovery.primitive_succeeded(2.0)
    assert recovery.state is S.IDLE and recovery.recovered == 1
    assert path(recovery) == ["hold", "retreat", "classical_return", "idle"]


def test_a_phase_without_a_plan_asks_a_human_and_aborts_without_answer(recovery):
    recovery.trigger(0.0, "release", "dropped")
    assert recovery.advance(0.2) is S.ASK_HUMAN
    assert recovery.advance(10.2) is S.ASK_HUMAN
    assert recovery.advance(10.21) is S.ABORT


@pytest.mark.parametrize("name", [[], {}, None, 3, object()], ids=lambda n: repr(n)[:8])
def test_what_is_no_phase_and_no_cause_raises_nothing_and_asks_a_human(recovery, name, tmp_path):
    recovery.trigger(0.0, name, name)
    assert recovery.advance(0.2) is S.ASK_HUMAN
    recovery.stop(0.3, name)
    write_journal(tmp_path / "j.mcap", [recovery._journal])


def test_a_person_resolves_by_name(recovery):
    recovery.trigger(0.0, "release", "dropped")
    recovery.advance(0.2)
    with pytest.raises(ContractError, match="without a person"):
        recovery.human_resolved(1.0, "")
    recovery.human_resolved(1.0, "spotter")
    assert recovery.state is S.IDLE and recovery.recovered == 0


def test_three_failures_abort(recovery):
    recovery.trigger(0.0, "insert", "jammed")
    for n in range(3):
        assert recovery.state is S.HOLD
        recovery.advance(n + 0.5)
        recovery.primitive_failed(n + 0.6, "rejected")
    assert recovery.state is S.ABORT and recovery.failures == 3
    recovery.trigger(9.0, "insert", "again")
    recovery.advance(99.0)
    assert recovery.state is S.ABORT


def test_a_primitive_that_takes_too_long_has_failed(recovery):
    recovery.trigger(0.0, "approach", "lost")
    recovery.advance(0.2)
    assert recovery.advance(5.2) is S.CLASSICAL_RETURN
    assert recovery.advance(5.3) is S.HOLD and recovery.failures == 1


def test_recovering_again_and_again_ends_with_a_human(recovery):
    for n in range(3):
        recovery.trigger(10.0 * n, "approach", "lost")
        recovery.advance(10.0 * n + 0.2)
        recovery.primitive_succeeded(10.0 * n + 1.0)
    recovery.trigger(40.0, "approach", "lost")
    assert recovery.advance(40.2) is S.ASK_HUMAN


REACH = {
    S.IDLE: lambda r: None,
    S.HOLD: lambda r: r.trigger(0.0, "insert", "x"),
    S.RETREAT: lambda r: (r.trigger(0.0, "insert", "x"), r.advance(1.0)),
    S.CLASSICAL_RETURN: lambda r: (r.trigger(0.0, "approach", "x"), r.advance(1.0)),
    S.ASK_HUMAN: lambda r: (r.trigger(0.0, "release", "x"), r.advance(1.0)),
    S.ABORT: lambda r: (r.trigger(0.0, "release", "x"), r.advance(1.0), r.advance(50.0)),
}


@pytest.mark.parametrize("state", REACH, ids=str)
def test_a_stop_is_reachable_from_every_state_and_sticky(recovery, state):
    REACH[state](recovery)
    assert recovery.state is state
    recovery.stop(100.0, "E-stop")
    recovery.trigger(101.0, "insert", "x")
    recovery.advance(150.0)
    assert recovery.state is S.STOPPED
    for nobody in ("", "\u200b", "-"):
        with pytest.raises(ContractError, match="without a person"):
            recovery.human_reset(1001.0, nobody)
    recovery.human_reset(1001.0, "spotter")
    assert recovery.state is S.IDLE


def test_what_does_not_fit_the_state_is_refused(recovery):
    for call in (
        recovery.primitive_succeeded,
        lambda t: recovery.primitive_failed(t, "x"),
        lambda t: recovery.human_resolved(t, "x"),
    ):
        with pytest.raises(ContractError, match="in state idle"):
            call(0.0)


class Session:
    """Recovery, executor and a fallback that reaches its goal after some actions."""

    def __init__(self, *, needed=12, admits=lambda n: True):
        self.rig = Rig()
        self.recovery = Recovery(EXECUTION, self.rig.journal)
        self.needed, self.admits, self.proposals = needed, admits, 0
        self.commands = []

    def admit(self, proposal):
        self.proposals += 1
        if not self.admits(self.proposals):
            return None
        fields = {name: getattr(proposal.metadata, name) for name in (
            "chunk_id", "policy_checkpoint_hash", "sampler_config_hash", "predecessor_chunk_id",
            "action_start_time_s", "valid_until_s", "task_phase", "method")}  # fmt: skip
        return self.rig.chunk(actions=proposal.actions, **fields)

    def plan(self, state):
        done = sum(command.kind == "fallback" for command in self.commands)
        return Primitive(np.tile(np.arange(10.0), (16, 1)), reached=done >= self.needed)

    def metadata(self):
        rig = self.rig
        return fallback_metadata(
            rig.executor, now_s=rig.now_s, chunk_id=f"fallback-{self.proposals}",
            event_time_s=rig.now_s, phase=rig.phase, epoch=rig.epoch,
        )  # fmt: skip

    def run(self, ticks):
        for _ in range(ticks):
            self.rig.observe()
            step(self.recovery, self.rig.executor, now_s=self.rig.now_s, metadata=self.metadata,
                 plan=self.plan, admit=self.admit)  # fmt: skip
            self.commands += self.rig.tick()

    def judged(self, also=()):
        report = check_messages(
            (e.kind, {"session": e.session, "n": e.n, "t": e.t, **e.payload})
            for e in self.rig.end()
        )
        assert {v.rule for v in report.violations} == {"settings.checks", *also}  # no `issued`
        assert self.rig.executor.conservation().error == 0
        return report


def test_the_fallback_commands_admitted_actions_and_hands_back():
    session = Session()
    session.run(2)
    session.rig.deliver(session.rig.chunk())
    session.recovery.trigger(session.rig.now_s, "approach", "lost")
    session.run(60)
    kinds = [command.kind for command in session.commands]
    assert kinds.count("fallback") >= 12 and "action" not in kinds
    assert session.recovery.state is S.IDLE and session.recovery.recovered == 1
    session.rig.observe()
    assert session.rig.deliver(session.rig.chunk()) is None
    assert session.rig.tick()[0].kind == "action"
    assert session.judged().checked_fallback_actions == kinds.count("fallback")


def test_a_fallback_that_feasibility_rejects_moves_nothing_and_aborts():
    session = Session(admits=lambda n: False)
    session.recovery.trigger(0.0, "approach", "lost")
    session.run(60)
    assert session.recovery.state is S.ABORT and session.proposals == 3
    assert {command.kind for command in session.commands} == {"hold"}
    session.judged()


def test_the_policy_is_not_heard_while_recovery_is_in_charge():
    session = Session()
    session.recovery.trigger(0.0, "release", "dropped")
    session.run(6)
    session.rig.observe()
    assert session.recovery.state is S.ASK_HUMAN
    assert session.rig.deliver(session.rig.chunk()) == "stopped"
    session.judged(also={"P8.called"})  # `step` asks; the executor is told by who calls it


def test_a_supervisor_stop_ends_recovery():
    session = Session()
    session.recovery.trigger(0.0, "approach", "lost")
    session.run(8)
    session.rig.supervisor.emergency_stop(session.rig.now_s)
    session.run(5)
    assert session.recovery.state is S.STOPPED
    assert [command.kind for command in session.commands[-5:]] == ["stop"] * 5
    session.judged()


def test_what_is_left_of_a_failed_primitive_is_not_executed():
    session = Session(needed=99)
    session.recovery.trigger(0.0, "approach", "lost")
    session.run(6)
    assert session.commands[-1].kind == "fallback"
    session.rig.advance(5.1)  # longer than a primitive may take
    session.run(1)
    assert session.recovery.state is S.HOLD and session.commands[-1].kind == "hold"
    session.judged()


def test_a_primitive_that_fails_mid_chunk_loses_its_rest():
    session = Session(needed=99)
    session.recovery.trigger(0.0, "approach", "lost")
    session.run(6)
    session.recovery._primitive_ns = 0  # times out at the next step, with actions still queued
    session.run(1)
    assert session.recovery.state is S.HOLD and session.commands[-1].kind == "hold"
    assert session.rig.executor.conservation().rest_discarded == {"stopped": 1}
    session.judged()


def test_one_failure_may_be_the_limit_and_plans_are_copied():
    plans = {"approach": (S.CLASSICAL_RETURN,)}
    cell = rig_cell(recovery_plans=plans, recovery_hold_s=0.0, maximum_failures=1)
    plans.clear()
    recovery = Recovery(cell.execution, Journal("r"))
    recovery.trigger(0.0, "approach", "lost")
    assert recovery.advance(0.0) is S.CLASSICAL_RETURN
    recovery.primitive_failed(0.1, "rejected")
    assert recovery.state is S.ABORT


@pytest.mark.parametrize("force_n", [math.inf, math.nan, 10**400, None, "hard"])
def test_a_force_that_is_no_number_is_the_largest_and_costs_no_journal(force_n, tmp_path):
    journal = Journal("rig")
    recovery = Recovery(EXECUTION, journal)
    recovery.trigger(0.0, "approach", "silence")
    for felt_n in (3.0, force_n, force_n, 4.0):
        recovery.feel(0.0, felt_n)
    told = [e.payload["force_n"] for e in journal.events() if e.kind == "recovery_force"]
    assert told == [3.0, sys.float_info.max]
    write_journal(tmp_path / "journal.mcap", [journal])
