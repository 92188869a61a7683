"""Force gate, collision gate, watchdog, stops: sticky until a person, deaf to anything learned."""

import ast
import math
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from playing import begin, judged

from genpolicy.errors import ContractError
from genpolicy.evidence.shadow.rig import EXECUTION, IMITATED, Rig, StandInContext, rig_cell
from genpolicy.execution import supervisor as module
from genpolicy.execution.checks import without
from genpolicy.execution.journal import Journal
from genpolicy.execution.nanoseconds import to_ns
from genpolicy.execution.supervisor import Supervisor, SupervisorState
from genpolicy.verification.checker import check_messages


@pytest.fixture
def supervisor():
    return Supervisor(EXECUTION, Journal("s"))


class Unreadable(float):
    """A number of which nobody can say how large it is."""

    def __float__(self):
        raise ValueError("unreadable")


def test_a_time_that_cannot_be_read_stands_in_the_way_of_no_stop(supervisor):
    supervisor.emergency_stop(Unreadable(1.0))
    assert supervisor.state == "emergency_stop"


@pytest.mark.parametrize("force_n, phase, trips", [
    (20.0, "approach", False), (math.nextafter(20.0, 30.0), "approach", True),
    (40.0, "insert", False), (41.0, "insert", True), (0.1, "unknown phase", True),
    (math.nan, "insert", True), (math.inf, "insert", True), (-1e-9, "insert", True),
    (-math.inf, "insert", True), (None, "insert", True), ("5", "insert", True),
    (1j, "insert", True), (0.0, "insert", False), (0, "insert", False),
    (np.float32(1.0), "insert", False), (1.0, ["insert"], True), (1.0, None, True),
    (False, "insert", True), (True, "insert", True), (np.bool_(False), "insert", True),
    (Fraction(1, 2), "insert", False), (10**400, "insert", True), (Unreadable(1.0), "insert", True),
])  # fmt: skip
def test_force_gate(supervisor, force_n, phase, trips):
    assert supervisor.observe_force(1.0, force_n, phase) is trips
    assert supervisor.stopped is trips


@pytest.mark.parametrize(("before", "now", "force_n", "trips"), [
    ("approach", "insert", 30.0, True), ("approach", "insert", 20.0, False),
    ("insert", "approach", 30.0, True), ("insert", "insert", 30.0, False),
    ("unknown phase", "insert", 1.0, True), ("insert", ["insert"], 1.0, True),
])  # fmt: skip
def test_where_the_phase_changed_since_the_smaller_limit_holds(
    supervisor, before, now, force_n, trips
):
    supervisor.observe_force(0.0, 0.0, before)
    assert supervisor.observe_force(1.0, force_n, now) is trips


def test_collision_gate(supervisor):
    assert supervisor.observe_collision(0.0, False) is False and not supervisor.stopped
    assert supervisor.observe_collision(0.1, True) is True and supervisor.stopped


def test_any_cause_may_stop_it_and_a_limit_of_zero_is_a_limit(supervisor):
    supervisor.emergency_stop(0.0, "light curtain")
    assert supervisor.state is SupervisorState.EMERGENCY_STOP and supervisor.stops == 1
    limits = {"approach": 0.0, "insert": 40.0}
    touchless = Supervisor(rig_cell(force_limit_n=limits).execution, Journal("s"))
    limits["approach"] = 99.0  # the settings keep their own copy
    assert touchless.observe_force(0.0, 0.0, "approach") is False
    assert touchless.observe_force(0.0, 1e-9, "approach") is True


def test_watchdog_holds_within_period_plus_watchdog(supervisor):
    supervisor.note_accepted(to_ns(1.0))
    held = [supervisor.poll(to_ns(1.0 + n * 0.05)) for n in range(6)]
    assert held == [False, False, False, True, False, False]  # 0.15 s = 0.05 + 0.1
    assert supervisor.state is SupervisorState.WATCHDOG_HOLD and not supervisor.stopped
    supervisor.note_accepted(to_ns(1.3))
    assert supervisor.state is SupervisorState.RUN


def test_long_silence_ends_in_a_protective_stop():
    quiet = rig_cell(silence_stop_s=1.0)
    supervisor = Supervisor(quiet.execution, Journal("s"))
    supervisor.note_accepted(0)
    supervisor.poll(to_ns(0.2))
    supervisor.poll(to_ns(1.0))
    assert not supervisor.stopped
    supervisor.poll(to_ns(1.05))
    assert supervisor.state is SupervisorState.PROTECTIVE_STOP


EVENTS = (
    "accept",
    "poll",
    "reset",
    "hand_back",
    "observe",
    "deliver",
    "tick",
    "swap",
    "small_force",
)


@given(st.lists(st.sampled_from(EVENTS), max_size=30))
@settings(max_examples=60, deadline=None, derandomize=True)
def test_nothing_but_a_person_clears_a_stop(events):
    rig = Rig()
    rig.observe()
    rig.deliver(rig.chunk())
    rig.tick()
    rig.supervisor.emergency_stop(rig.now_s)
    actions = {
        "accept": lambda: rig.supervisor.note_accepted(rig.now_ns),
        "poll": lambda: rig.advance(0.2),
        "reset": lambda: rig.executor.reset(rig.now_s),
        "hand_back": lambda: rig.executor.hand_back(rig.now_s),
        "observe": rig.observe,
        "deliver": lambda: rig.deliver(rig.chunk()),
        "tick": rig.tick,
        "swap": lambda: rig.executor.set_active(rig.now_s, "f" * 64, "f" * 64),
        "small_force": lambda: rig.supervisor.observe_force(rig.now_s, 0.0, "approach"),
    }
    accepted = rig.stub.accepted
    for event in events:
        actions[event]()
    assert rig.tick()[0].kind == "stop"
    assert rig.supervisor.state is SupervisorState.EMERGENCY_STOP
    assert rig.stub.accepted == accepted


def test_a_protective_stop_does_not_replace_an_emergency_stop(supervisor):
    supervisor.emergency_stop(0.0)
    supervisor.observe_collision(0.1, True)
    assert supervisor.state is SupervisorState.EMERGENCY_STOP


def test_a_person_clears_it_by_name_and_old_observations_stay_void():
    rig = Rig()
    rig.observe()
    rig.supervisor.observe_collision(0.0, True)
    with pytest.raises(ContractError, match="without a person"):
        rig.supervisor.human_reset(0.1, "  ")
    before = rig.chunk()
    rig.advance(0.1)
    rig.supervisor.human_reset(rig.now_s, "spotter")
    assert rig.deliver(before) == "stopped"
    rig.observe()
    assert rig.deliver(rig.chunk()) is None
    assert rig.tick()[0].kind == "action"


def test_it_has_no_way_to_hear_a_score():
    tree = ast.parse(Path(module.__file__).read_text())
    names = {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}
    assert not {name for name in names if "score" in name or "ood" in name or "clear" in name}
    words = {node.arg for node in ast.walk(tree) if isinstance(node, ast.arg)}
    assert not words & {"score", "confidence", "probability", "uncertainty"}


class Unprintable:
    def __str__(self):
        raise ValueError("no text")


NO_TIMES = (math.nan, math.inf, -math.inf, 1e300, None, 10**400, "now", 0.5, 99999.0)


@pytest.mark.parametrize("now_s", NO_TIMES, ids=lambda t: repr(t)[:8])
@pytest.mark.parametrize("stop", [
    lambda s, now_s: s.emergency_stop(now_s),
    lambda s, now_s: s.emergency_stop(now_s, Unprintable()),
    lambda s, now_s: s.observe_force(now_s, 1e6, "approach"),
    lambda s, now_s: s.observe_force(now_s, Unprintable(), Unprintable()),
    lambda s, now_s: s.observe_collision(now_s, True),
])  # fmt: skip
def test_a_stop_needs_no_valid_argument(stop, now_s):
    """With a time that is none each of them raised, and the next tick commanded an action."""
    rig = Rig()
    rig.now_ns = 1_000_000_000
    rig.observe()
    rig.deliver(rig.chunk())
    assert rig.tick()[0].kind == "action"
    stop(rig.supervisor, now_s)
    assert rig.supervisor.stopped and rig.tick()[0].kind == "stop"
    rig.end()


@pytest.mark.parametrize("told", [None, math.nan, 0, "", [], np.True_, 1])
def test_a_collision_that_is_not_surely_none_stops(supervisor, told):
    assert supervisor.observe_collision(0.0, told) is True and supervisor.stopped


def test_the_absence_of_a_collision_may_be_said_by_numpy(supervisor):
    assert supervisor.observe_collision(0.0, np.False_) is False and not supervisor.stopped


@pytest.mark.parametrize("person", ["", " ", None, 3, "\u200b", "\u00ad", "-", "ann\u2060"])
def test_nobody_clears_no_stop(supervisor, person):
    supervisor.emergency_stop(0.0)
    with pytest.raises(ContractError, match="without a person"):
        supervisor.human_reset(0.1, person)
    assert supervisor.stopped


def test_a_person_who_looked_says_what_time_it_is():
    rig = Rig()
    rig.executor.tick(0.0)
    for _ in range(3):  # the clock has jumped by an hour, and stays there
        assert rig.executor.tick(3600.0).reason == "clock_ahead"
    rig.supervisor.human_reset(3600.0, "spotter")
    rig.now_ns = 3600 * 10**9
    assert [c.kind for c in rig.run(3)] == ["action"] * 3


def test_a_stop_after_the_end_is_heard_and_is_no_fault_of_the_journal():
    rig = Rig()
    rig.executor.end_episode(0.0)
    rig.supervisor.emergency_stop(0.1)
    assert rig.supervisor.stopped
    report = check_messages(
        (e.kind, {"session": e.session, "n": e.n, "t": e.t, **e.payload})
        for e in rig.journal.events()
    )
    assert {violation.rule for violation in report.violations} == {"settings.checks"}


@pytest.mark.parametrize("now_s", [math.nan, None, 999.0, -1.0])
def test_a_poll_with_a_clock_that_is_not_believed_is_silence(now_s):
    """It measured none, so that nobody noticed that the executor was dead."""
    rig = Rig()
    begin(rig)
    rig.stub.poll(now_s)
    assert rig.supervisor.state is SupervisorState.WATCHDOG_HOLD
    assert rig.executor.tick(now_s).kind == "hold"
    assert rig.tick()[0].reason == "broken_predecessor"  # the rest was checked in motion
    assert rig.run(1, predecessor_chunk_id="")[0].kind == "action"
    assert rig.supervisor.state is SupervisorState.RUN


def test_a_clock_far_ahead_stops_where_silence_stops():
    rig = Rig(silence_stop_s=1.0)
    rig.stub.poll(500.0)
    assert not rig.supervisor.stopped  # nothing was commanded yet
    begin(rig)
    rig.stub.poll(math.nan)
    assert not rig.supervisor.stopped
    rig.stub.poll(500.0)
    assert rig.supervisor.stopped and rig.tick()[0].kind == "stop"


def test_after_the_end_nothing_is_noted_but_a_stop():
    rig = Rig()
    begin(rig)
    rig.executor.end_episode(rig.now_s)
    events = len(rig.journal.events())
    for now_s in (rig.now_s, math.nan, rig.now_s + 30.0):
        assert rig.executor.tick(now_s).reason == "ended"
        rig.stub.poll(now_s)
    assert len(rig.journal.events()) == events
    rig.supervisor.emergency_stop(math.nan)
    assert rig.executor.tick(rig.now_s + 31.0).kind == "stop"
    assert [e.kind for e in rig.journal.events()[events:]] == ["supervisor"]


def test_after_a_cleared_stop_a_chunk_from_where_the_arm_stands_goes_on():
    rig = Rig()
    begin(rig)
    rig.supervisor.emergency_stop(rig.now_s)
    rig.tick(2)
    rig.supervisor.human_reset(rig.now_s, "spotter")
    elsewhere = StandInContext(last_action=np.full(10, 0.7), measured_at_s=rig.now_s)
    rig.observe(tcp_m=[0.7, 0.7, 0.7])
    rig.deliver(rig.chunk(context=elsewhere, predecessor_chunk_id=""))
    assert [c.kind for c in rig.tick(2)] == ["action"] * 2
    judged(rig)


def replaced(rig):
    """The supervisor died, and another one takes over in the same session."""
    rig.stub.supervisor = Supervisor(rig.cell.execution, rig.journal, checks=rig.stub.checks)
    return rig.stub.supervisor


BEFORE = {
    "run": lambda rig: None,
    "watchdog_hold": lambda rig: rig.advance(0.2),
    "protective_stop": lambda rig: rig.supervisor.observe_collision(rig.now_s, True),
    "emergency_stop": lambda rig: rig.supervisor.emergency_stop(rig.now_s),
}


@pytest.mark.parametrize("state", BEFORE)
def test_one_that_starts_again_begins_stopped_until_a_named_person_looked(state):
    rig = Rig()
    begin(rig)
    BEFORE[state](rig)
    assert rig.supervisor.state == state
    new, accepted = replaced(rig), rig.stub.accepted
    assert new.state is SupervisorState.PROTECTIVE_STOP and new.stops == 1
    assert rig.journal.last("supervisor") == {
        "event": "restarted", "state": "protective_stop", "detail": "",
    }  # fmt: skip
    assert [command.kind for command in rig.tick(2)] == ["stop"] * 2
    assert {command.kind for command in rig.run(3, predecessor_chunk_id="")} == {"stop"}
    with pytest.raises(ContractError, match="without a person"):
        new.human_reset(rig.now_s, "")
    assert rig.stub.accepted == accepted
    new.human_reset(rig.now_s, "spotter")
    assert [c.kind for c in rig.run(2, predecessor_chunk_id="")] == ["action"] * 2
    judged(rig)


def test_the_first_of_a_session_runs_and_each_further_one_stops():
    journal = Journal("s")
    assert Supervisor(EXECUTION, journal).state is SupervisorState.RUN
    assert Supervisor(EXECUTION, journal).state is SupervisorState.RUN  # nothing happened yet
    journal.add("scene", journal.clock(0.0), {"bodies": {}})
    for _ in range(2):
        assert Supervisor(EXECUTION, journal).stopped
    assert [event.payload["event"] for event in journal.events()[1:]] == ["restarted"] * 2


def test_a_chunk_from_before_stays_void_although_the_old_one_had_stopped_as_often():
    """Both have stopped once: whoever counts stops alone sees no second one."""
    rig = Rig()
    begin(rig)
    rig.supervisor.emergency_stop(rig.now_s)
    rig.tick()
    rig.supervisor.human_reset(rig.now_s, "spotter")
    rig.run(2, predecessor_chunk_id="")
    rig.observe()
    rig.deliver(rig.chunk())
    replaced(rig).human_reset(rig.now_s, "spotter")  # at once, and the chunk is as new as that
    assert rig.tick()[0].kind == "hold" and rig.executor.conservation().chunks.queued == 0
    judged(rig)


@pytest.mark.parametrize("blind", ["executor", "stub"])
def test_executor_and_stub_each_heed_a_new_one(blind):
    blinded = without(IMITATED, "stopped")
    tables = {"checks": blinded} if blind == "executor" else {"stub_checks": blinded}
    rig = Rig(**({"stub_checks": IMITATED} | tables))
    begin(rig)
    accepted = rig.stub.accepted
    replaced(rig)
    rig.run(3, predecessor_chunk_id="")
    assert rig.stub.accepted == accepted
