"""Whether the way from the last command to a row was checked; the answer never raises."""

from types import SimpleNamespace

import numpy as np
import pytest

from genpolicy.execution.continuity import Continuity, bytes_of

ACTION = np.arange(10.0)


def chunk(last_action=ACTION):
    return SimpleNamespace(context=SimpleNamespace(last_action=last_action))


def after(own, row=3, action=ACTION):
    continuity = Continuity()
    continuity.note(7, own, row, action)
    return continuity


def test_at_first_only_the_first_checked_row_follows():
    continuity = Continuity()
    assert continuity.follows(chunk(None), 2, 2) and continuity.given_ns is None
    assert not continuity.follows(chunk(), 2, 3) and not continuity.follows(chunk(), 2, 1)


def test_of_the_same_chunk_the_next_row_alone_follows():
    own = chunk()
    continuity = after(own)
    assert [row for row in range(8) if continuity.follows(own, 0, row)] == [4]
    assert continuity.given_ns == 7


def test_another_chunk_follows_from_the_command_that_it_was_checked_from():
    continuity = after(chunk())
    assert continuity.follows(chunk(ACTION.copy()), 1, 1)
    assert not continuity.follows(chunk(ACTION.copy()), 1, 2)
    other = ACTION.copy()
    other[0] = np.nextafter(other[0], 1.0)
    assert not continuity.follows(chunk(other), 1, 1)


def test_an_equal_chunk_is_not_the_same_one():
    told = ACTION + 1.0
    own, twin = chunk(told), chunk(told)
    assert own == twin and own is not twin and not after(own).follows(twin, 0, 4)


@pytest.mark.parametrize("told", [None, "text", object(), [[1.0], [1.0, 2.0]]])
def test_what_does_not_say_its_command_follows_nothing(told):
    continuity = after(chunk())
    assert not continuity.follows(chunk(told), 0, 0)
    assert not continuity.follows(SimpleNamespace(), 0, 0)


def test_what_is_forgotten_binds_nobody_and_the_pace_stays():
    own = chunk()
    continuity = after(own)
    continuity.forget()
    assert not continuity.follows(own, 0, 4) and continuity.follows(chunk(None), 0, 0)
    assert continuity.given_ns == 7


def test_bytes_are_of_numbers_only():
    assert bytes_of([1, 2]) == np.array([1.0, 2.0]).tobytes()
    assert bytes_of("a") == bytes_of(object()) == b""
