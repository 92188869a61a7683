"""Whether the way from the last command to a row was checked; the answer never raises."""

from types import SimpleNamespace

import numpy as np
import pytest

from genpolicy.execution.seam import Seam, bytes_of

ACTION = np.arange(10.0)


def chunk(last_action=ACTION):
    return SimpleNamespace(context=SimpleNamespace(last_action=last_action))


def after(own, row=3, action=ACTION):
    seam = Seam()
    seam.note(7, own, row, action)
    return seam


def test_at_first_only_the_first_checked_row_follows():
    seam = Seam()
    assert seam.follows(chunk(None), 2, 2) and seam.given_ns is None
    assert not seam.follows(chunk(), 2, 3) and not seam.follows(chunk(), 2, 1)


def test_of_the_same_chunk_the_next_row_alone_follows():
    own = chunk()
    seam = after(own)
    assert [row for row in range(8) if seam.follows(own, 0, row)] == [4]
    assert seam.given_ns == 7


def test_another_chunk_follows_from_the_command_that_it_was_checked_from():
    seam = after(chunk())
    assert seam.follows(chunk(ACTION.copy()), 1, 1)
    assert not seam.follows(chunk(ACTION.copy()), 1, 2)
    other = ACTION.copy()
    other[0] = np.nextafter(other[0], 1.0)
    assert not seam.follows(chunk(other), 1, 1)


def test_an_equal_chunk_is_not_the_same_one():
    told = ACTION + 1.0
    own, twin = chunk(told), chunk(told)
    assert own == twin and own is not twin and not after(own).follows(twin, 0, 4)


@pytest.mark.parametrize("told", [None, "text", object(), [[1.0], [1.0, 2.0]]])
def test_what_does_not_say_its_command_follows_nothing(told):
    seam = after(chunk())
    assert not seam.follows(chunk(told), 0, 0)
    assert not seam.follows(SimpleNamespace(), 0, 0)


def test_what_is_forgotten_binds_nobody_and_the_pace_stays():
    own = chunk()
    seam = after(own)
    seam.forget()
    assert not seam.follows(own, 0, 4) and seam.follows(chunk(None), 0, 0)
    assert seam.given_ns == 7


def test_bytes_are_of_numbers_only():
    assert bytes_of([1, 2]) == np.array([1.0, 2.0]).tobytes()
    assert bytes_of("a") == bytes_of(object()) == b""
