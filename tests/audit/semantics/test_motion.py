"""The paired motion: angles unwrapped, seams cut."""

from dataclasses import replace

import numpy as np
from arms import SETTINGS, arms

from genpolicy.audit.semantics import measure
from genpolicy.audit.semantics.motion import make_motion


def test_jumps_by_a_turn_are_a_note_and_no_motion():
    data = arms(41, width=3)
    angles = 12.0 * data.observation
    asked = 12.0 * data.action
    wrap = np.pi
    wrapped = replace(
        data,
        observation=(angles + wrap) % (2 * wrap) - wrap,
        action=(asked + wrap) % (2 * wrap) - wrap,
    )
    motion = make_motion(wrapped)
    assert motion.wraps > 0
    inside = wrapped.episode[1:] == wrapped.episode[:-1]
    assert np.abs(np.diff(motion.observed, axis=0))[inside].max() < 2.2
    found = measure(wrapped, SETTINGS)
    assert found.findings == () and "whole turn" in found.notes[0]
