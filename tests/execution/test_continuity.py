"""Whether the way from the last command to a row was checked; the answer never raises."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from playing import begin, checked, judged

from genpolicy.evidence.shadow.rig import IMITATED, Rig
from genpolicy.execution.checks import without
from genpolicy.execution.continuity import Continuity, bytes_of, knows, rests
from genpolicy.execution.moment import View
from genpolicy.execution.nanoseconds import NEVER_NS

ACTION = np.arange(10.0)


def chunk(last_action=ACTION, before=((0.0, 0.0), (0.0, 0.0))):
    context = SimpleNamespace(last_action=last_action, q_cmd=(0.0, 0.0), q_cmd_history=before)
    return SimpleNamespace(context=context)


HERE = View(tcp_m=(0.0, 1.0, 2.0), divergence_limit_m=0.05)


def follows(own, of, first, row, now_ns=57, view=HERE):
    about = SimpleNamespace(checked_rows=(first, 16), times=SimpleNamespace(period_ns=50))
    return own.follows(of, about, row, now_ns, view)


def after(own, row=3, action=ACTION):
    continuity = Continuity()
    continuity.note(7, own, row, action)
    return continuity


def test_at_first_only_the_first_checked_row_follows():
    continuity = Continuity()
    assert follows(continuity, chunk(), 2, 2) and continuity.given_ns is None
    assert not follows(continuity, chunk(), 2, 3) and not follows(continuity, chunk(), 2, 1)


def test_of_the_same_chunk_the_next_row_alone_follows():
    own = chunk()
    continuity = after(own)
    assert [row for row in range(8) if follows(continuity, own, 0, row)] == [4]
    assert continuity.given_ns == 7


def test_another_chunk_follows_from_the_command_that_it_was_checked_from():
    continuity = after(chunk())
    assert follows(continuity, chunk(ACTION.copy()), 1, 1)
    assert not follows(continuity, chunk(ACTION.copy()), 1, 2)
    other = ACTION.copy()
    other[0] = np.nextafter(other[0], 1.0)
    assert not follows(continuity, chunk(other), 1, 1)


def test_an_equal_chunk_is_not_the_same_one():
    told = ACTION + 1.0
    own, twin = chunk(told), chunk(told)
    assert own == twin and own is not twin and not follows(after(own), twin, 0, 4)


@pytest.mark.parametrize("told", [None, "text", object(), [[1.0], [1.0, 2.0]]])
def test_what_does_not_say_its_command_follows_nothing(told):
    continuity = after(chunk())
    assert not follows(continuity, chunk(told), 0, 0)
    assert not follows(continuity, SimpleNamespace(), 0, 0)


def test_what_is_forgotten_binds_nobody_and_the_pace_stays():
    own = chunk()
    continuity = after(own)
    continuity.forget()
    assert not follows(continuity, own, 0, 4) and follows(continuity, chunk(), 0, 0)
    assert continuity.given_ns == 7


def test_bytes_are_of_numbers_only():
    assert bytes_of([1, 2]) == np.array([1.0, 2.0]).tobytes()
    assert bytes_of("a") == bytes_of(object()) == b""


MOVING = ((0.0, 0.1), (0.0, 0.05))


@pytest.mark.parametrize(
    ("now_ns", "before", "holds"),
    [(57, MOVING, True), (81, MOVING, True), (82, MOVING, False), (107, MOVING, False),
     (107, ((0.0, 0.1), (0.0, 0.0)), True), (157, ((0.0, 0.1), (0.0, 0.0)), False),
     (157, ((0.0, 0.0), (0.0, 0.0)), True), (5007, ((0.0, 0.0), (0.0, 0.0)), True),
     (107, ((0.0, 0.0), (0.0, 1e-7)), True), (107, np.zeros((0, 2)), False), (107, None, False),
     (107, "moving", False)],
)  # fmt: skip
def test_after_holds_only_an_arm_that_stood_still_goes_on(now_ns, before, holds):
    """The same last command, reached in motion: from rest it was twice the acceleration."""
    continuity = after(chunk())
    assert follows(continuity, chunk(ACTION.copy(), before), 0, 0, now_ns) is holds


def test_a_stop_that_was_cleared_is_forgotten_once():
    continuity = after(chunk())
    continuity.after(10)
    assert follows(continuity, chunk(before=MOVING), 0, 0, 107), "no command is left to rest on"
    continuity.note(20, chunk(), 0, ACTION)
    continuity.after(10)
    assert not follows(continuity, chunk(before=MOVING), 0, 0, 120)


OFF_M = math.nextafter(0.05, 1.0)


@pytest.mark.parametrize(
    ("told", "seen", "holds"),
    [(ACTION, (0.0, 1.0, 2.0), True), (ACTION, (0.05, 1.0, 2.0), True),
     (ACTION, (OFF_M, 1.0, 2.0), False), (ACTION, (0.04, 1.04, 2.0), False),
     (ACTION, None, False), (None, (0.0, 1.0, 2.0), False), ("text", (0.0, 1.0, 2.0), False),
     (np.full(10, math.nan), (0.0, 1.0, 2.0), False), ([0.0, 1.0], (0.0, 1.0, 2.0), False)],
)  # fmt: skip
def test_where_no_command_says_where_the_arm_is_a_chunk_begins_where_it_is_seen(told, seen, holds):
    view = View(tcp_m=seen, divergence_limit_m=0.05)
    assert follows(Continuity(), chunk(told), 0, 0, view=view) is holds
    # The command says it, as long as there is one.
    assert follows(after(chunk()), chunk(ACTION.copy()), 0, 0, view=view)


def _person(rig):
    rig.executor.intervene(rig.now_s)
    rig.executor.hand_back(rig.now_s)


def _stop(rig):
    rig.supervisor.emergency_stop(rig.now_s)
    rig.tick()
    rig.supervisor.human_reset(rig.now_s, "rita")


NO_COMMAND = {
    "the session begins": lambda rig: None,
    "a reset": lambda rig: (rig.run(2), rig.executor.reset(rig.now_s)),
    "a person had it": lambda rig: (rig.run(2), _person(rig)),
    "a stop was cleared": lambda rig: (rig.run(2), _stop(rig)),
}
AWAY = {"elsewhere": [0.1, 0.0, 0.0], "nobody says": [], "no place": [math.nan, 0.0, 0.0]}


def _goes_on(rig, off_m):
    """A chunk that says it was checked from the last command; the arm is seen so far from there."""
    here = rig.tcp_m
    rig.observe(tcp_m=here + off_m if len(off_m) else [])
    before = rig.stub.accepted
    rig.deliver(rig.chunk(predecessor_chunk_id=""))
    rig.tick(2)
    return rig.stub.accepted - before


@pytest.mark.parametrize("name", NO_COMMAND)
def test_what_goes_on_was_checked_from_where_the_arm_is(name):
    rig = Rig()
    NO_COMMAND[name](rig)
    assert _goes_on(rig, np.array([0.049, 0.0, 0.0])) == 2
    judged(rig)


@pytest.mark.parametrize("away", AWAY)
@pytest.mark.parametrize("name", NO_COMMAND)
@pytest.mark.parametrize("blind", ["nobody", "checks", "stub_checks"])
def test_what_was_checked_from_elsewhere_moves_nothing(name, away, blind):
    """Executor and stub each ask; a chunk of a far place would be a jump to it."""
    tables = {"checks": IMITATED, "stub_checks": IMITATED}
    if blind != "nobody":
        tables[blind] = without(IMITATED, "continuity")
    rig = Rig(**tables)
    NO_COMMAND[name](rig)
    assert _goes_on(rig, np.array(AWAY[away])) == 0
    assert not {v.rule for v in checked(rig.end()).violations} - {"settings.checks"}


@pytest.mark.parametrize("away", AWAY)
@pytest.mark.parametrize("name", NO_COMMAND)
def test_the_checker_finds_a_jump_to_where_the_arm_is_not(name, away):
    rig = Rig(checks=without(IMITATED, "continuity"))
    NO_COMMAND[name](rig)
    assert _goes_on(rig, np.array(AWAY[away])) == 2
    found = {v.rule for v in checked(rig.end()).violations}
    assert "P5.here" in found and found <= {"P5.here", "P5.continuity", "settings.checks"}


def test_what_cannot_be_read_rests_on_nothing():
    assert rests(None, 0) and not rests(None, 1) and not rests(object(), 2)


@pytest.mark.parametrize("given", [1, 2, 3, 7])
@pytest.mark.parametrize("told", [0, 1, 2, 3])
def test_a_chunk_was_checked_with_the_commands_before_the_last(given, told):
    """Without them nobody asked for acceleration and jerk at the seam."""
    continuity, own = Continuity(), chunk()
    for row in range(given):
        continuity.note(50 * row, own, row, ACTION)
    follower = chunk(ACTION.copy(), np.zeros((told, 2)))
    assert follows(continuity, follower, 0, 0, 50 * given) is (told >= min(given - 1, 2))
    continuity.forget()
    continuity.note(0, own, 0, ACTION)
    assert follows(continuity, chunk(ACTION.copy(), np.zeros((0, 2))), 0, 0, 50)


@pytest.mark.parametrize(
    ("before", "velocity", "begins"),
    [((), None, False), (((0.0, 0.0),), None, False), (((0.0, 0.0),) * 2, None, True),
     ((), (0.0, 0.0), True)],
)  # fmt: skip
def test_where_no_command_says_how_the_arm_moves_a_chunk_knows_it(before, velocity, begins):
    """By two commands before, or as it was measured; else feasibility asked for no acceleration."""
    own = chunk(before=before)
    own.context.dq_meas = velocity
    assert follows(Continuity(), own, 0, 0) is begins
    assert follows(after(chunk()), own, 0, 0), "one command alone has none before it"
    stopped = after(chunk())
    stopped.forget()
    assert follows(stopped, own, 0, 0) is begins


@pytest.mark.parametrize("told", [None, "moving", [[0.0], [0.0, 1.0]]])
def test_a_history_that_cannot_be_read_is_none(told):
    assert not knows(SimpleNamespace(q_cmd_history=told), 1) and knows(None, 0)


MS = 1_000_000


def at(rig, ms, *times_s):
    """The command of a tick so many ms after the first; the clock says other things if it must."""
    rig.now_ns = ms * MS
    return [rig.executor.tick(time_s) for time_s in (times_s or (rig.now_s,))][-1]


def interrupted(name, **tables):
    """One row, then something in between, then the tick at which the next row is due."""
    rig = Rig(watchdog_s=0.05, **tables)
    begin(rig, ticks=1)
    return rig, INTERRUPTIONS[name](rig)


INTERRUPTIONS = {
    "nearly two periods": lambda rig: at(rig, 99),
    "half a period more": lambda rig: at(rig, 75),
    "a tick just before the row is due": lambda rig: (at(rig, 49), at(rig, 99))[-1],
    "no time": lambda rig: at(rig, 50, math.nan, rig.now_s),
    "a clock that went back": lambda rig: at(rig, 50, -0.1, rig.now_s),
    "a clock that leapt": lambda rig: at(rig, 50, 3600.0, rig.now_s),
    "the controller's own watchdog": lambda rig: (
        setattr(rig, "now_ns", 55 * MS), rig.stub.poll(rig.now_s), at(rig, 60))[-1],
}  # fmt: skip


@pytest.mark.parametrize("name", INTERRUPTIONS)
def test_after_a_hold_the_rest_of_a_chunk_needs_a_new_admission(name):
    """It was checked as one motion, and the arm had stopped: from rest it is another one."""
    rig, command = interrupted(name)
    assert (command.kind, command.reason) == ("hold", "broken_predecessor")
    assert rig.executor.conservation().rest_discarded == {"broken_predecessor": 1}
    assert rig.executor.conservation().actions.discarded["broken_predecessor"] == 7
    assert [c.kind for c in rig.run(2, predecessor_chunk_id="")] == ["action"] * 2
    judged(rig)


@pytest.mark.parametrize("name", INTERRUPTIONS)
@pytest.mark.parametrize("blind", ["checks", "stub_checks"])
def test_executor_and_stub_hear_of_a_hold_each_for_itself(name, blind):
    tables = {"checks": IMITATED, "stub_checks": IMITATED}
    rig, command = interrupted(name, **tables | {blind: without(IMITATED, "continuity")})
    assert command.kind == "hold" and rig.stub.accepted == 1
    assert rig.stub.stale == (blind == "checks")


@pytest.mark.parametrize("name", INTERRUPTIONS)
def test_the_checker_sees_it_where_nobody_asks(name):
    rig, command = interrupted(name, checks=without(IMITATED, "continuity"))
    assert command.kind == "action" and rig.stub.accepted == 2
    found = {v.rule for v in checked(rig.end()).violations}
    assert found == {"settings.checks", "P5.continuity"}


@pytest.mark.parametrize("ms", [45, 50, 55, 74])
def test_a_command_that_is_some_ms_early_or_late_is_no_hold(ms):
    """Neither is the watchdog of this very tick: what it holds, it holds for no time."""
    rig = Rig(watchdog_s=0.05)
    rig.observe()
    rig.deliver(rig.chunk())
    shift = max(50 - ms, 0)  # the first comes so late that this one is not before its window
    assert at(rig, shift).kind == "action" and at(rig, ms + shift).kind == "action"
    judged(rig)


def test_a_loop_may_ask_several_times_a_period():
    """What is not due yet is held for; the arm goes on to where it was sent all the while."""
    rig = Rig()
    rig.observe()
    rig.deliver(rig.chunk())
    assert [at(rig, ms).reason for ms in range(0, 200, 10)] == ["", *["empty"] * 4] * 4
    judged(rig)


def test_after_a_hold_the_next_chunk_was_checked_from_rest():
    """However short it was by the clock: one that is doubted measures no time."""
    moving, rested = chunk(before=((0.0, 0.1), (0.0, 0.05))), chunk()
    for held_ns, holds in ((None, True), (57, True), (56, False), (NEVER_NS, False)):
        continuity = after(chunk())
        for at_ns in () if held_ns is None else (held_ns, 57):
            continuity.held(at_ns)
        assert follows(continuity, moving, 0, 0) is holds and follows(continuity, rested, 0, 0)
        continuity.note(57, rested, 0, ACTION)
        assert follows(continuity, rested, 0, 1, 107), "the next command ends it"
