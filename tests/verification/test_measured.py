"""Measured states: a journal that is right, and one for each way to have measured otherwise."""

from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

from genpolicy.verification.measured import Measured

MS = 1_000_000
SESSION = ("session", {"t": 0, "labels": {"start_sha256": "ab"}})
COLUMNS = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0]
POSE = [0.1, 0.2, 0.3, *COLUMNS, 0.01]
SEEN = np.array([[9.0, *POSE]] * 2)
RATES = np.array([2.0, 2.0, 2.0, 0.2])


def robot(seen=lambda row: row[1:], placed=None):
    """An arm that stands upright, its TCP at the first three joints; the last turns slowly."""
    expected = SimpleNamespace(arm_rates=np.stack([RATES, RATES]), seen=seen, placed=placed)
    return SimpleNamespace(forward=lambda q_rad: (q_rad[:3], np.eye(3)), expected=expected)


def state(t, **changes):
    payload = {
        "q_rad": [0.1, 0.2, 0.3, 0.4], "tcp_m": [0.1, 0.2, 0.3], "tcp_rotation": COLUMNS,
        "gripper_m": 0.01, "force_n": 0.0,
    }  # fmt: skip
    return "state", {"t": t * MS, **payload, **changes}


def at(t, x):
    """A state with the arm moved along its first joint."""
    return state(t, q_rad=[x, 0.2, 0.3, 0.4], tcp_m=[x, 0.2, 0.3])


def exposed(t):
    return "exposure", {"t": t * MS}


def there(t):
    return "arrived", {"exposed_ns": t * MS}


def saw(t, history=SEEN):
    text = np.asarray(history, dtype="<f8").tobytes().hex()
    return "conditioning", {"id": "a", "exposed_ns": t * MS, "rows": len(history), "history": text}


def queued(t, q_rad=(0.1, 0.2, 0.3, 0.4)):
    motion = {"measured_ns": t * MS, "q_meas_rad": np.array(q_rad, dtype="<f8").tobytes().hex()}
    return "enqueue", {"chunk_id": "a", "motion": motion}


def felt(t, force_n):
    return "force", {"t": t * MS, "force_n": force_n}


END = ("end", {"t": 100 * MS})
TICKS = (state(0), exposed(0), state(50), exposed(50))
BOTH = (*TICKS, there(0), there(50))
MOVED = (at(0, 0.1), at(50, 0.2), there(0), there(50))
SAW_MOVED = SEEN + np.array([[0.0] * 11, [0.0, 0.1, *[0.0] * 9]])


def rules(*events, session=SESSION, proof=None):
    seen = Measured(proof or robot())
    return [rule for kind, m in (session, *events) for rule, _ in seen.follow(kind, m)]


def test_a_state_at_every_tick_and_at_the_end():
    assert rules(*BOTH, saw(50), queued(50), felt(100, 2.0), state(100, force_n=2.0), END) == []
    # Six decimals are what is stated.
    assert rules(*BOTH, queued(50, (0.1 + 4e-7, 0.2, 0.3, 0.4)), saw(50, SEEN + 4e-7)) == []
    assert rules(*TICKS, there(0), saw(0)) == []  # the first is repeated
    assert rules(*MOVED, saw(50, SAW_MOVED)) == []  # by 0.1 rad in 50 ms, as fast as it can
    assert rules(*TICKS, there(50), there(0), saw(50)) == []  # an older one came later
    assert rules(*TICKS, felt(100, 2.0), state(100, force_n=2.0), state(150, force_n=1.0)) == []
    fallback = ("enqueue", {"chunk_id": "a", "motion": None})  # a violation of its own
    assert rules(*TICKS, fallback) == []


@pytest.mark.parametrize(
    ("events", "rule"),
    [
        ((exposed(0),), "state.missing"),
        ((*TICKS, exposed(100)), "state.missing"),
        ((*TICKS, END), "state.missing"),
        ((*TICKS, state(50)), "state.again"),
        ((*TICKS, state(40)), "state.again"),
        ((*TICKS, state(100, gripper_m=float("nan"))), "state.number"),
        ((*TICKS, queued(50, (0.1, 0.2, 0.3, 0.41))), "state.joints"),
        ((*TICKS, queued(50, (0.1, 0.2, 0.3))), "state.joints"),
        ((*TICKS, queued(60)), "state.joints"),
        ((*BOTH, saw(50, SEEN + np.array([[0.0], [1e-5]]))), "state.seen"),
        ((*BOTH, saw(50, SEEN + np.eye(2, 11, 10) * 1e-5)), "state.seen"),
        ((*BOTH, saw(50, np.roll(SEEN, 3, axis=1)[-1:])), "state.seen"),  # in another channel
        ((*MOVED, saw(50, SAW_MOVED[::-1])), "state.seen"),  # an older row is not the newest
        ((*MOVED, saw(50, SAW_MOVED[[1, 1]])), "state.seen"),  # nor is the newest an older one
        ((*TICKS, there(0), there(60), saw(60, SEEN)), "state.seen"),
        ((*BOTH, saw(0)), "state.seen"),
        ((*TICKS, saw(50)), "state.seen"),
        ((at(0, 0.1), at(50, 0.2001)), "state.speed"),
        ((state(0), state(50, q_rad=[0.1, 0.2, 0.3, 0.389])), "state.speed"),
        ((*TICKS, state(100, force_n=2.0)), "state.force"),
        ((*TICKS, felt(100, 2.0), state(100, force_n=1.0)), "state.force"),
        ((*TICKS, state(100), felt(100, 2.0)), "state.force"),
        ((*TICKS, state(100, tcp_m=[0.1, 0.2, 0.30002])), "state.pose"),
        ((*TICKS, state(100, tcp_rotation=[1.0, 0.0, 0.0, 0.0, 0.999, 0.04])), "state.pose"),
    ],
)
def test_what_was_not_measured_so_is_found(events, rule):
    assert set(rules(*events)) == {rule}


def test_a_session_without_a_virtual_clock_is_not_asked():
    assert rules(exposed(0), END, session=("session", {"labels": {}})) == []


def test_without_a_robot_joints_and_tcp_are_not_held_together():
    seen = Measured()
    elsewhere = state(100, tcp_m=[0.0, 0.0, 0.0], q_rad=[9.0] * 4)
    events = (SESSION, *BOTH, elsewhere, END, saw(50, SEEN + 1.0))
    assert [one for kind, m in events for one in seen.follow(kind, m)] == []


def test_who_does_not_say_where_the_tcp_is_seen_is_not_asked():
    assert rules(*BOTH, saw(50, SEEN + 1.0), proof=robot(seen=None)) == []


@pytest.mark.parametrize(("told_m", "found"), [
    (0.3, []), (0.3000015, []), (0.29999, ["state.divergence"]), (None, ["state.divergence"]),
])  # fmt: skip
def test_how_far_the_arm_is_off_lies_between_state_and_command(told_m, found):
    action = np.array([0.1, 0.2, 0.6, *COLUMNS, 0.01], dtype="<f8").tobytes().hex()
    looks = [
        ("observation", {"t": t * MS, "divergence_m": away_m, "tcp_m": state(t)[1]["tcp_m"]})
        for t, away_m in ((0, None), (50, told_m))
    ]
    journal = [SESSION, state(0), looks[0], ("accept", {"t": 0, "action": action}), state(50),
               looks[1]]  # fmt: skip
    view = Measured(robot())
    assert [rule for kind, m in journal for rule, _ in view.follow(kind, m)] == found


@pytest.mark.parametrize(("off_m", "found"), [
    (0.0, []), (9e-7, []), (1e-4, ["state.place"]), (None, ["state.place"]),
])  # fmt: skip
def test_where_an_observation_has_the_arm_the_state_has_it(off_m, found):
    tcp_m = [] if off_m is None else [part + off_m for part in state(50)[1]["tcp_m"]]
    look = ("observation", {"t": 50 * MS, "divergence_m": None, "tcp_m": tcp_m})
    view = Measured(robot())
    told = [rule for kind, m in (SESSION, *BOTH, look) for rule, _ in view.follow(kind, m)]
    assert told == found


@pytest.mark.parametrize(("velocity", "found"), [
    ([0.2, 0.0, 0.0, 0.0], []), ([0.20003, 0.0, 0.0, 0.0], []),
    ([0.2001, 0.0, 0.0, 0.0], ["state.velocity"]), (None, ["state.velocity"]),
])  # fmt: skip
def test_a_chunk_is_checked_at_the_velocity_that_the_states_have(velocity, found):
    session = ("session", {**SESSION[1], "period_ns": 50 * MS})
    kind, chunk = queued(50, (0.11, 0.2, 0.3, 0.4))
    told = None if velocity is None else np.array(velocity, "<f8").tobytes().hex()
    chunk["motion"]["dq_meas_rad_s"] = told
    view = Measured(robot())
    journal = [session, at(0, 0.1), at(50, 0.11), (kind, chunk)]
    assert [rule for own, m in journal for rule, _ in view.follow(own, m)] == found


@pytest.mark.parametrize(("bodies", "found"), [
    ({"post": [9.0] * 7}, []), ({"post": [9.0] * 6 + [9.01]}, ["state.scene"]),
    ({}, ["state.scene"]), ({"box": [9.0] * 7}, ["state.scene"]),
])  # fmt: skip
def test_the_scene_on_record_is_the_one_that_was_seen(bodies, found):
    """What is seen has the place of the post in its first number, seven times."""
    told = {name: np.array(pose, "<f8").tobytes().hex() for name, pose in bodies.items()}
    shown = lambda row: {"post": (row[[0, 0, 0]], row[[0, 0, 0, 0]])}  # noqa: E731
    view = Measured(robot(placed=shown))
    journal = [SESSION, state(0), ("scene", {"t": 0, "bodies": told}), exposed(0), there(0),
               saw(0, SEEN[:1])]  # fmt: skip
    assert [rule for kind, m in journal for rule, _ in view.follow(kind, m)] == found


def test_a_period_that_is_no_whole_number_of_nanoseconds_has_a_state_before():
    """Ticks of a thirtieth of a second are rounded, each for itself."""
    period_s = 1 / 30
    times_ns = [round(k * period_s * 1e9) for k in range(4)]
    assert len({b - a for a, b in pairwise(times_ns)}) == 2
    session = ("session", {"t": 0, "labels": {"start_sha256": "ab"}, "period_ns": 33_333_333})
    still = np.zeros(4, "<f8").tobytes().hex()
    for first, second in pairwise(times_ns):
        before, now = (("state", {**state(0)[1], "t": t}) for t in (first, second))
        kind, chunk = queued(0)
        motion = {**chunk["motion"], "measured_ns": second, "dq_meas_rad_s": still}
        told = (before, now, (kind, {**chunk, "motion": motion}))
        assert "state.velocity" not in rules(*told, session=session)
