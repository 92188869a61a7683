"""Meetings of episodes: what may be a copy is kept, and what only crosses is not."""

import numpy as np
import pytest

from genpolicy.audit.semantics.meetings import LOOKED_AT, may_cover
from genpolicy.seeds import stream

ASKED = {"near": 0.5, "least": 12, "own": 0.3, "of": 0.7}


@pytest.mark.parametrize("length", [20, 2 * LOOKED_AT + 40])
def test_two_that_agree_everywhere_may_be_copies_and_two_that_cross_may_not(length):
    rng = stream(3, "meetings")
    one = rng.normal(size=(length, 2)).cumsum(axis=0) * 5.0
    other = one + rng.normal(size=one.shape) * 10.0
    crossed = np.where((np.abs(np.arange(length) - length // 2) < 7)[:, None], one, other)
    starts = np.array([0, length, 2 * length])
    meeting = np.array([[length // 2, length + length // 2]])
    assert may_cover(np.vstack([one, one]), starts, meeting, **ASKED).all()
    near = np.linalg.norm(one - crossed, axis=1) <= ASKED["near"]
    assert 13 <= near.sum() < 0.7 * length
    assert not may_cover(np.vstack([one, crossed]), starts, meeting, **ASKED).any()
    # The same rows met twice are counted twice: a bound may be too high, and never too low.
    twice = np.repeat(meeting, 1 + length // 13, axis=0)
    assert may_cover(np.vstack([one, crossed]), starts, twice, **ASKED).all()


def test_no_meeting_and_no_row_beyond_the_ends():
    signal, starts = np.zeros((24, 1)), np.array([0, 12, 24])
    assert may_cover(signal, starts, np.zeros((0, 2), dtype=np.int64), **ASKED).shape == (0,)
    ends = np.array([[0, 12], [11, 23], [0, 23]])
    assert may_cover(signal, starts, ends[:2], **ASKED).all()
    assert not may_cover(signal, starts, ends[2:], **ASKED).any()
