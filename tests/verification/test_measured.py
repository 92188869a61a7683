"""Measured states: a journal that is right, and one for each way to have measured otherwise."""

import numpy as np
import pytest

from genpolicy.verification.measured import Measured

MS = 1_000_000
SESSION = ("session", {"t": 0, "labels": {"start_sha256": "ab"}})
COLUMNS = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0]
SEEN = np.array([[9.0] * 5, [9.0, 0.1, 0.2, 0.3, 9.0]])


def arm(q_rad):
    """An arm that stands upright, its TCP at the first three joints."""
    return q_rad[:3], np.eye(3)


def state(t, **changes):
    payload = {
        "q_rad": [0.1, 0.2, 0.3, 0.4], "tcp_m": [0.1, 0.2, 0.3], "tcp_rotation": COLUMNS,
        "gripper_m": 0.01, "force_n": 0.0,
    }  # fmt: skip
    return "state", {"t": t * MS, **payload, **changes}


def exposed(t):
    return "exposure", {"t": t * MS}


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


def rules(*events, session=SESSION, forward=arm):
    seen = Measured(forward)
    return [rule for kind, m in (session, *events) for rule, _ in seen.follow(kind, m)]


def test_a_state_at_every_tick_and_at_the_end():
    assert rules(*TICKS, saw(50), queued(50), felt(100, 2.0), state(100, force_n=2.0), END) == []
    # Six decimals are what is stated.
    assert rules(*TICKS, queued(50, (0.1 + 4e-7, 0.2, 0.3, 0.4)), saw(0, SEEN + 4e-7)) == []
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
        ((*TICKS, saw(50, SEEN + 1e-5)), "state.seen"),
        ((*TICKS, saw(50, SEEN[::-1])), "state.seen"),  # an older row is not the newest
        ((*TICKS, saw(60)), "state.seen"),
        ((*TICKS, state(100, force_n=2.0)), "state.force"),
        ((*TICKS, felt(100, 2.0), state(100, force_n=1.0)), "state.force"),
        ((*TICKS, state(100), felt(100, 2.0)), "state.force"),
        ((*TICKS, state(100, tcp_m=[0.1, 0.2, 0.30002])), "state.pose"),
        ((*TICKS, state(100, tcp_rotation=[1.0, 0.0, 0.0, 0.0, 0.999, 0.04])), "state.pose"),
    ],
)
def test_what_was_not_measured_so_is_found(events, rule):
    assert rules(*events) == [rule]


def test_a_session_without_a_virtual_clock_is_not_asked():
    assert rules(exposed(0), END, session=("session", {"labels": {}})) == []


def test_without_a_robot_joints_and_tcp_are_not_held_together():
    assert rules(*TICKS, state(100, tcp_m=[0.0, 0.0, 0.0]), END, forward=None) == []
