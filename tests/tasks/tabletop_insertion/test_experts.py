"""Operators: within limits, on two sides whose mean runs into the post."""

import numpy as np
import pytest

from genpolicy.tasks.tabletop_insertion.episodes import demonstrate
from genpolicy.tasks.tabletop_insertion.sessions import episode_specs

SPECS = episode_specs(21, 24, shares={"nominal": 1.0})


@pytest.fixture(scope="module")
def nominal():
    return [demonstrate(spec) for spec in SPECS]


def test_undisturbed_operators_succeed(nominal):
    assert sum(done.success for done in nominal) >= 0.95 * len(nominal)


def test_operators_keep_to_their_limits(nominal):
    for done in nominal:
        steps = np.linalg.norm(np.diff(done.actions[:, :3], axis=0), axis=1)
        assert steps.max() / 0.05 < 0.5
        acceleration = np.diff(done.actions[:, :3], n=2, axis=0) / 0.05**2
        assert np.linalg.norm(acceleration, axis=1).max() < 2.5


def test_the_mean_of_left_and_right_runs_into_the_post(nominal):
    left = next(d for s, d in zip(SPECS, nominal, strict=True) if s.mode == "left")
    right = next(d for s, d in zip(SPECS, nominal, strict=True) if s.mode == "right")
    mean = 0.5 * (left.actions[:16] + right.actions[:16])
    # The hand's front face is 30 mm before the TCP, the post's surface at x = 0.475 m.
    assert mean[-1, 0] + 0.030 > 0.475
    assert abs(mean[-1, 1]) < 0.06
    for done in (left, right):
        assert abs(done.actions[15, 1]) > 0.10
