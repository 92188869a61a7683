"""Alignment: a finger that trails the arm is; a step of a coarse search is no difference."""

from dataclasses import replace

import numpy as np
import pytest
from arms import SETTINGS, arms

from genpolicy.audit.semantics.alignment import aligned
from genpolicy.audit.semantics.clocks import measure_lags
from genpolicy.audit.semantics.drift import drift_findings, episode_drifts
from genpolicy.audit.semantics.following import following
from genpolicy.audit.semantics.motion import make_motion

STEPS = SETTINGS.maximum_lag_rows


def late(motion, column, rows):
    """The observation of one column so many rows later than it came."""
    at = np.arange(len(motion.observed))
    first = np.repeat(motion.starts[:-1], np.diff(motion.starts))
    observed = motion.observed.copy()
    observed[:, column] = observed[np.maximum(at - rows, first), column]
    return replace(motion, observed=observed)


def made(seed=1, **kwargs):
    data = arms(seed, **kwargs)
    return data, make_motion(data)


def done(data, motion):
    return aligned(motion, following(motion, data.period_s, STEPS), STEPS)


@pytest.mark.parametrize("rows", [0, 1])
def test_columns_that_hardly_differ_stay_as_they_are(rows):
    data, motion = made()
    motion = late(motion, 2, rows)
    assert done(data, motion) is motion


@pytest.mark.parametrize("rows", [4, 6])
def test_a_column_that_trails_the_others_is_commanded_later(rows):
    data, motion = made(width=4, rows=(90, 120))
    found = done(data, late(motion, 3, rows))
    np.testing.assert_array_equal(found.commanded[:, :3], motion.commanded[:, :3])
    first, last = motion.starts[:2]
    np.testing.assert_array_equal(
        found.commanded[first + rows : last, 3], motion.commanded[first : last - rows, 3]
    )


@pytest.mark.parametrize("step", [-3, 2, 3])
def test_a_step_of_the_coarse_search_is_no_difference_and_makes_no_drift(step):
    data, motion = made(rows=(90, 120))
    follows = following(motion, data.period_s, STEPS)
    lag = follows.lag.copy()
    lag[:, 2] += step
    found = aligned(motion, replace(follows, lag=lag), STEPS)
    assert found is motion
    drifts = episode_drifts(found, measure_lags(found, SETTINGS).steps, SETTINGS)
    assert drift_findings(drifts, data, SETTINGS) == []
