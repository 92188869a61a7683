"""Calibration: a shift at rest between epochs, and nothing else."""

import numpy as np
from arms import SETTINGS, arms, last_epoch, parts, rebuilt

from genpolicy.audit.semantics import measure


def mapped(data, chosen, change):
    commands, seen = parts(data)
    seen = [change(part) if chosen[k] else part for k, part in enumerate(seen)]
    return rebuilt(data, commands, seen)


def first(data, settings=SETTINGS):
    findings = measure(data, settings).findings
    return (findings[0].kind, findings[0].where) if findings else ("", "")


def test_a_shift_at_rest_is_a_calibration():
    data = arms(42)
    shift = np.array([0.02, 0.0, 0.0])
    assert first(mapped(data, last_epoch(data), lambda part: part + shift))[0] == "calibration"
    everywhere = mapped(data, np.ones(60, dtype=bool), lambda part: part + shift)
    assert measure(everywhere, SETTINGS).findings == ()
