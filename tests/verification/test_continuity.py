"""The checker's own words for what may follow the last command."""

import struct
from types import SimpleNamespace

import numpy as np
import pytest

from genpolicy.verification.continuity import COMMANDS, HERE, PACE, RULE, Continuity
from genpolicy.verification.seen import JOINTS

PERIOD = 50


def told(*numbers):
    return struct.pack(f"<{len(numbers)}d", *numbers).hex()


A, B, C = (told(*[number] * 10) for number in (0.0, 1.0, 2.0))
SETTINGS = {"period_ns": PERIOD, "maximum_divergence_m": 0.05}


def seen(tcp_m, event_ns=0, *, used=True):
    return {"used": used, "tcp_m": list(tcp_m), "event_time_ns": event_ns}


def began(proof=None, tcp_m=(0.0, 0.0, 0.0)):
    """A session in which the arm was seen where a chunk says that it was checked from."""
    own = Continuity(proof)
    own.see("observation", seen(tcp_m))
    return own


def chunk(first=0, last_action=A, motion=True, before=(0.0, 0.0)):
    ground = {
        "last_action": last_action,
        "q_cmd_rad": told(0.0, 0.0),
        "q_before_rad": told(*before),
        "dq_meas_rad_s": told(0.0, 0.0),
    }
    return {
        "chunk_id": "c", "checked_rows": [first, 16], "motion": ground if motion else None,
    }  # fmt: skip


def accept(t, row, *, arrival=0, action=A):
    return {"t": t, "row": row, "arrival": arrival, "action": action}


def rules(*steps, forget=None, there=(0.0, 0.0, 0.0)):
    own, found = began(), []
    for place, (of, m) in enumerate(steps):
        if place == forget:
            own.forget()
            own.see("observation", seen(there))
        found.append([rule for rule, _ in own.follow(of, m, SETTINGS)])
    return found


def test_row_after_row_is_right():
    own = chunk(first=2)
    assert rules((own, accept(0, 2)), (own, accept(50, 3)), (own, accept(100, 4))) == [[], [], []]


@pytest.mark.parametrize("row", [0, 2, 4, 5])
def test_a_row_that_does_not_follow(row):
    own = chunk()
    assert rules((own, accept(0, 2)), (own, accept(50, row)))[1] == [RULE]


def test_a_first_row_is_the_first_that_was_checked():
    assert rules((chunk(first=2), accept(0, 3))) == [[RULE]]
    start = (chunk(), accept(0, 0))
    assert rules(start, (chunk(first=2), accept(50, 3, arrival=1)))[1] == [RULE]


def test_another_chunk_was_checked_from_the_last_command():
    start = (chunk(), accept(0, 0, action=B))
    assert rules(start, (chunk(last_action=B), accept(50, 0, arrival=1)))[1] == []
    assert rules(start, (chunk(last_action=C), accept(50, 0, arrival=1)))[1] == [RULE]
    # What it was checked against is missing: a violation of its own (P6.ground).
    assert rules(start, (chunk(motion=False), accept(50, 0, arrival=1)))[1] == []


def test_after_somebody_else_moved_the_arm_no_command_binds():
    start, other = (chunk(), accept(0, 0)), (chunk(last_action=C), accept(50, 0, arrival=1))
    assert rules(start, other, forget=1, there=(2.0, 2.0, 2.0))[1] == []
    assert rules(start, (chunk(), accept(20, 0, arrival=1)), forget=1)[1] == [PACE]


@pytest.mark.parametrize(
    ("there", "found"),
    [((0.0, 0.0, 0.05), []), ((0.0, 0.0, 0.0501), [HERE]), ((), [HERE]), ((0.0, 0.0), [HERE])],
)
def test_without_a_command_a_chunk_begins_where_the_arm_was_seen(there, found):
    own = began(tcp_m=there)
    own.see("observation", seen((0.0, 0.0, 0.0), used=False))  # it is not believed
    own.see("state", {"tcp_m": [0.0, 0.0, 0.0]})
    assert [rule for rule, _ in own.follow(chunk(), accept(0, 0), SETTINGS)] == found
    assert rules((chunk(), accept(0, 0)), (chunk(), accept(50, 1)))[1] == []


@pytest.mark.parametrize(
    ("before", "velocity", "found"),
    [((), None, [HERE]), ((0.0, 0.0), None, [HERE]), ((0.0,) * 4, None, []), ((), told(0, 0), []),
     ((0.0, 0.0), told(3, 0), [])],
)  # fmt: skip
def test_without_a_command_a_chunk_knows_how_the_arm_moved(before, velocity, found):
    """By two commands before or as measured; of neither no acceleration was ever asked."""
    first = chunk(before=before)
    first["motion"]["dq_meas_rad_s"] = velocity
    assert rules((first, accept(0, 0))) == [found]
    start = (chunk(), accept(0, 0))
    assert rules(start, (first, accept(50, 0, arrival=1))) == [[], []], "behind a command"
    assert rules(start, (first, accept(50, 0, arrival=1)), forget=1) == [[], found]


def test_what_another_session_saw_says_nothing():
    own = began()
    own.forget(blind=True)
    assert [rule for rule, _ in own.follow(chunk(), accept(0, 0), SETTINGS)] == [HERE]
    # A chunk that says nothing of what it was checked against is a violation of its own.
    assert not list(Continuity().follow(chunk(motion=False), accept(0, 0), SETTINGS))


@pytest.mark.parametrize(("t", "found"), [(44, [PACE]), (45, []), (50, []), (74, []), (0, [PACE])])
def test_the_pace_is_nine_tenths_of_a_period(t, found):
    own = chunk()
    assert rules((own, accept(0, 0)), (own, accept(t, 1)))[1] == found


@pytest.mark.parametrize(
    ("t", "before", "found"),
    [(50, (0.0, 0.1), []), (74, (0.0, 0.1), []), (76, (0.0, 0.1), [RULE]),
     (100, (0.0, 0.1), [RULE]),
     (100, (0.1, 0.0, 0.0, 0.0), []), (150, (0.1, 0.0, 0.0, 0.0), [RULE]), (400, (), []),
     (400, (0.0, 1e-7), [])],
)  # fmt: skip
def test_after_holds_a_chunk_was_checked_from_an_arm_that_stood_still(t, before, found):
    start = (chunk(), accept(0, 0))
    assert rules(start, (chunk(before=before), accept(t, 0, arrival=1)))[1] == found


HELD = [("watchdog", 0), ("watchdog", 49), ("no_time", 50), ("clock_backwards", 0),
        ("clock_ahead", 0)]  # fmt: skip


@pytest.mark.parametrize(
    ("t", "found"), [(50, []), (74, []), (75, [RULE]), (99, [RULE]), (100, [RULE]), (900, [RULE])]
)
def test_after_a_hold_by_the_clock_no_row_of_the_same_chunk_follows(t, found):
    own = chunk()
    assert rules((own, accept(0, 0)), (own, accept(t, 1)))[1] == found


@pytest.mark.parametrize(("reason", "t"), HELD)
def test_after_a_hold_on_record_none_follows_and_another_one_was_checked_from_rest(reason, t):
    """By the watchdog, earlier than the action; for a doubted clock, whatever that says."""
    for second, found in (
        ((chunk(), accept(50, 1)), [RULE]),
        ((chunk(before=(0.0, 0.1)), accept(50, 0, arrival=1)), [RULE]),
        ((chunk(), accept(50, 0, arrival=1)), []),
    ):
        own = began()
        assert not list(own.follow(chunk(), accept(0, 0), SETTINGS))
        own.hold({"t": t, "reason": reason})
        own.hold({"t": 50, "reason": "watchdog"})
        assert [rule for rule, _ in own.follow(*second, SETTINGS)] == found
        assert not list(
            own.follow(
                second[0], accept(100, second[1]["row"] + 1, arrival=second[1]["arrival"]), SETTINGS
            )
        )


@pytest.mark.parametrize(("reason", "t"), [("empty", 20), ("watchdog", 50)])
def test_what_is_not_due_and_what_goes_on_at_once_is_no_hold(reason, t):
    own = began()
    assert not list(own.follow(chunk(), accept(0, 0), SETTINGS))
    own.hold({"t": t, "reason": reason})
    assert not list(own.follow(chunk(), accept(50, 1), SETTINGS))


class Slide:
    """A robot of one joint that moves its TCP along x; its second number is its branch."""

    expected = SimpleNamespace(branch_rad=0.1, torque_nm=np.ones(2), tcp_speed_m_s=2e7)

    @staticmethod
    def forward(q_rad):
        return np.array([q_rad[0], 0.0, 0.0]), np.eye(3)


def at(x):
    return told(x, 0, 0, 1, 0, 0, 0, 1, 0, 0)


def slid(q_cmd, before, *, rows=4, measured=(0.0, 0.0), measured_ns=0):
    """A chunk that goes on from these joints by one in every row."""
    ground = {
        "last_action": at(q_cmd[0]), "q_cmd_rad": told(*q_cmd), "joints": 2,
        "q_before_rad": told(*np.ravel(before)),
        "q_meas_rad": told(*measured), "measured_ns": measured_ns, "dq_meas_rad_s": told(0, 0),
        "q_rad": told(*np.ravel([[q_cmd[0] + 1 + k, q_cmd[1]] for k in range(rows)])),
    }  # fmt: skip
    return {"chunk_id": "c", "checked_rows": [0, rows], "motion": ground}


def slides(second, *, t=100, after=2, forget=False, hold=""):
    """Findings of a chunk behind so many rows of one that began at 0."""
    own, first = began(Slide()), slid((0.0, 0.0), [])
    for row in range(after):
        assert not list(own.follow(first, accept(50 * row, row, action=at(row + 1.0)), SETTINGS))
    if forget:
        own.forget()
        own.see("observation", seen((7.0, 0.0, 0.0), 50))
    own.hold({"t": t, "reason": hold})
    found = own.follow(second, accept(t, 0, arrival=1, action=at(9.0)), SETTINGS)
    return [rule for rule, _ in found]


def test_the_joints_that_a_chunk_was_checked_from_are_those_that_were_commanded():
    assert slides(slid((2.0, 0.0), [[0.5, 0.0], [1.0, 0.0]])) == []
    assert slides(slid((2.0, 0.05), [[1.0, 0.05]])) == [], "the same pose from another begin"


@pytest.mark.parametrize(
    ("q_cmd", "before"),
    [
        ((2.001, 0.0), [[1.0, 0.0]]), ((2.0, 0.0), [[1.001, 0.0]]), ((2.0, 0.0), [[2.0, 0.0]]),
        ((2.0, 0.0), []), ((2.0, 0.2), [[1.0, 0.2]]),
    ],
)  # fmt: skip
def test_joints_that_nobody_commanded_or_that_are_left_out_are_found(q_cmd, before):
    """Speed, acceleration and jerk of the first rows were checked from there."""
    second = slid(q_cmd, before)
    second["motion"]["last_action"] = at(2.0)
    assert set(slides(second)) == {COMMANDS}


def test_a_hold_counts_as_a_command():
    assert slides(slid((2.0, 0.0), [[1.0, 0.0], [2.0, 0.0]]), t=150) == []
    assert slides(slid((2.0, 0.0), [[2.0, 0.0]]), t=150) == [COMMANDS], "of three one is left out"
    assert slides(slid((2.0, 0.0), [[2.0, 0.0], [2.0, 0.0]]), t=150) == [COMMANDS]
    assert slides(slid((2.0, 0.0), [[2.0, 0.0], [2.0, 0.0]]), t=200) == []


def test_a_doubted_clock_held_for_a_command_too_whatever_it_says():
    assert slides(slid((2.0, 0.0), [[1.0, 0.0], [2.0, 0.0]]), hold="no_time") == []
    assert slides(slid((2.0, 0.0), [[1.0, 0.0], [2.0, 0.0]]), t=150, hold="no_time") == []
    moving = slides(slid((2.0, 0.0), [[0.5, 0.0], [1.0, 0.0]]), hold="no_time")
    assert set(moving) == {RULE, COMMANDS}


def test_who_moved_the_arm_left_the_commands_behind():
    there = {"measured": (7.0, 0.0), "measured_ns": 50}
    assert slides(slid((7.0, 3.0), [], **there), forget=True) == []
    elsewhere = slid((7.0, 0.0), [], **there)
    elsewhere["motion"]["last_action"] = at(7.001)
    assert slides(elsewhere, forget=True) == [COMMANDS]


@pytest.mark.parametrize(
    ("measured", "found"),
    [((0.0, 0.0), []), ((9e-6, 0.0), []), ((1.1e-5, 0.0), [JOINTS]), ((-0.1, 0.0), [JOINTS]),
     ((np.nan, 0.0), [JOINTS])],
)  # fmt: skip
def test_the_measured_joints_put_the_tcp_where_it_was_seen(measured, found):
    """Whether or not a command says where the arm is."""
    second = slid((2.0, 0.0), [[0.5, 0.0], [1.0, 0.0]], measured=measured)
    assert slides(second) == found
    own = began(Slide())
    first = slid((0.0, 0.0), [], measured=measured)
    assert [r for r, _ in own.follow(first, accept(0, 0, action=at(1.0)), SETTINGS)] == found


@pytest.mark.parametrize(
    ("at_ns", "measured", "found"),
    [(60, 0.0, []), (60, 1.1e-5, []), (60, 0.2, []), (60, 0.21, [JOINTS]), (100, 3.0, []),
     (100, 2.9, [JOINTS]), (149, 3.97, []), (-1, 0.0, [JOINTS])],
)  # fmt: skip
def test_what_was_seen_at_the_time_counts_and_later_the_tcp_may_have_gone_on(
    at_ns, measured, found
):
    """As fast as it may, 20 mm a ns; what is seen later than the measurement says nothing."""
    own = began(Slide())
    own.see("observation", seen((0.0, 0.0, 0.0), 50))
    own.see("observation", seen((3.0, 0.0, 0.0), 100))
    own.see("observation", seen((9.0, 0.0, 0.0), 100, used=False))
    chunk = slid((3.0, 0.0), [], measured=(measured, 0.0), measured_ns=at_ns)
    assert [r for r, _ in own.follow(chunk, accept(150, 0, action=at(4.0)), SETTINGS)] == found


def test_joints_of_a_time_when_nobody_saw_the_arm_are_found():
    for looks in ([], [seen(())], [seen((0.0, 0.0))], [seen((0.0, 0.0, 0.0), 1)]):
        own = Continuity(Slide())
        for look in looks:
            own.see("observation", look)
        found = own.follow(slid((0.0, 0.0), []), accept(5, 0, action=at(1.0)), SETTINGS)
        assert JOINTS in [rule for rule, _ in found]
    own = began(Slide())
    own.forget(blind=True)
    found = own.follow(slid((0.0, 0.0), []), accept(5, 0, action=at(1.0)), SETTINGS)
    assert [rule for rule, _ in found] == [HERE, JOINTS]


def test_only_the_first_row_of_a_chunk_is_held_against_what_was_seen():
    own, first = began(Slide()), slid((0.0, 0.0), [], measured=(1.0, 0.0))
    found = [
        [
            rule
            for rule, _ in own.follow(first, accept(50 * row, row, action=at(row + 1.0)), SETTINGS)
        ]
        for row in range(3)
    ]
    assert found == [[JOINTS], [], []]
