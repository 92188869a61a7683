"""Chunk-to-chunk consistency: only the rows that speak of one time are compared."""

from dataclasses import replace

import numpy as np
import pytest

from genpolicy.monitors.consistency import ChunkConsistency
from genpolicy.monitors.protocol import Invocation


@pytest.fixture
def monitor(kit):
    return ChunkConsistency.fitted(kit.fit())


def following(chunk, *, rows):
    """An invocation whose chunk goes on exactly as the one before said."""
    before = Invocation(0.0, np.zeros((2, 3)), chunk)
    own = np.concatenate([chunk[:, rows:], np.full((len(chunk), rows, 2), 9.0)], axis=1)
    return Invocation(rows * 0.05, np.zeros((2, 3)), own, before)


def test_who_goes_on_as_it_said_scores_nothing(monitor):
    chunk = np.random.default_rng(1).normal(size=(3, 4, 2))
    for rows in (1, 2, 3):
        assert monitor.score(following(chunk, rows=rows)) == pytest.approx(0.0, abs=1e-12)


def test_who_says_otherwise_scores_by_how_much(monitor):
    chunk = np.zeros((1, 4, 2))
    told = following(chunk, rows=2)
    other = [replace(told, chunks=told.chunks + shift) for shift in (0.1, 0.5)]
    assert 0 < monitor.score(other[0]) < monitor.score(other[1])


def test_the_first_and_who_comes_too_late_are_compared_with_nothing(monitor, kit):
    first = kit.invocation()
    assert monitor.score(first) == 0.0
    assert monitor.score(replace(first, time_s=5.0, before=first)) == 0.0
