"""Lag that grows along an episode, or over the recordings."""

import numpy as np
import pytest
from arms import SETTINGS, arms, late, parts, rebuilt

from genpolicy.audit.semantics import measure
from genpolicy.audit.semantics.drift import drift_findings
from genpolicy.seeds import stream


def test_a_drift_along_the_episode_is_named():
    data = arms(14, epochs=1)
    drifting = late(data, lambda n: np.linspace(-2, 2, n), np.ones(60, dtype=bool))
    found = measure(drifting, SETTINGS).findings
    assert found[0].kind == "clock_drift" and found[0].unit == "steps per episode"
    assert found[0].measured == pytest.approx(4, rel=0.3)


def test_a_drift_within_the_spread_of_episodes_is_the_way_of_moving():
    data = arms(22, epochs=1, episodes=400)
    rng = stream(8, "drifts")
    assert drift_findings(2.0 + 0.3 * rng.normal(size=400), data, SETTINGS)
    assert not drift_findings(2.0 + 3.0 * rng.normal(size=400), data, SETTINGS)


@pytest.mark.parametrize("shape", ["step", "trend"])
def test_a_lag_that_changes_over_the_recordings_is_named(shape):
    data = arms(15, epochs=1, episodes=80)
    commands, seen = parts(data)
    for k in range(80):
        steps = 2.5 * (k >= 50) if shape == "step" else 3.0 * k / 79
        n = len(seen[k])
        at = np.clip(np.arange(n) - steps, 0, n - 1)
        seen[k] = np.stack([np.interp(at, np.arange(n), c) for c in seen[k].T], axis=1)
    found = measure(rebuilt(data, commands, seen), SETTINGS).findings
    assert found[0].kind in ("clock", "clock_drift")
