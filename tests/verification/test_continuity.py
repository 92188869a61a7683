"""The checker's own words for what may follow the last command."""

import struct

import pytest

from genpolicy.verification.continuity import PACE, RULE, Continuity

PERIOD = 50


def told(*numbers):
    return struct.pack(f"<{len(numbers)}d", *numbers).hex()


def chunk(first=0, last_action="aa", motion=True, before=(0.0, 0.0)):
    ground = {
        "last_action": last_action,
        "q_cmd_rad": told(0.0, 0.0),
        "q_before_rad": told(*before),
    }
    return {
        "chunk_id": "c", "checked_rows": [first, 16], "motion": ground if motion else None,
    }  # fmt: skip


def accept(t, row, *, arrival=0, action="aa"):
    return {"t": t, "row": row, "arrival": arrival, "action": action}


def rules(*steps, forget=None):
    own, found = Continuity(), []
    for place, (of, m) in enumerate(steps):
        if place == forget:
            own.forget()
        found.append([rule for rule, _ in own.follow(of, m, PERIOD)])
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
    start = (chunk(), accept(0, 0, action="bb"))
    assert rules(start, (chunk(last_action="bb"), accept(50, 0, arrival=1)))[1] == []
    assert rules(start, (chunk(last_action="bc"), accept(50, 0, arrival=1)))[1] == [RULE]
    # What it was checked against is missing: a violation of its own (P6.ground).
    assert rules(start, (chunk(motion=False), accept(50, 0, arrival=1)))[1] == []


def test_after_somebody_else_moved_the_arm_no_command_binds():
    start, other = (chunk(), accept(0, 0)), (chunk(last_action="zz"), accept(50, 0, arrival=1))
    assert rules(start, other, forget=1)[1] == []
    assert rules(start, (chunk(), accept(20, 0, arrival=1)), forget=1)[1] == [PACE]


@pytest.mark.parametrize(("t", "found"), [(44, [PACE]), (45, []), (50, []), (99, []), (0, [PACE])])
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
