"""The controls: a clock, and the spread of the draws."""

from dataclasses import replace

import numpy as np
import pytest

from genpolicy.monitors.controls import SampleVariance, TimeInEpisode
from genpolicy.monitors.protocol import Invocation, Unavailable


def test_the_clock_is_the_clock(kit):
    assert TimeInEpisode.fitted(kit.fit()).score(kit.invocation(time_s=1.25)) == 1.25


def test_variance_by_hand(kit):
    """Candidates at both ends of the range of one action of two: variance 1 there, 0 else."""
    fit = kit.fit("flow")
    ends = np.stack([fit.normalisation.action.minimum, fit.normalisation.action.maximum])
    chunks = np.repeat(ends[:, None], 4, axis=1)
    chunks[:, :, 1] = 0.0
    monitor = SampleVariance.fitted(fit)
    assert monitor.score(Invocation(0.0, np.zeros((2, 3)), chunks)) == pytest.approx(0.5)


def test_who_draws_the_same_chunk_has_no_variance(kit):
    """Whoever it is: of one candidate per invocation there is no variance of 0 either."""
    for method in ("chunked_bc", "flow", None):
        found = SampleVariance.fitted(replace(kit.fit(method), candidates=1))
        assert isinstance(found, Unavailable)
        assert "one candidate" in found.why
