"""Calibration: a shift at rest between epochs, and nothing else."""

from dataclasses import replace

import numpy as np
import pytest
from arms import SETTINGS, arms, last_epoch, parts, rebuilt

from benchmarks.audit.plan import Defect, Plan
from benchmarks.audit.recorder import record
from benchmarks.audit.settings import SETTINGS as TASK_SETTINGS
from genpolicy.audit.data import canonical
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


JUMPS = Plan(4, episodes=60, object_move_m=0.01, object_jumps=True)
UNSEEN = replace(JUMPS, defects=(Defect("latch", 1.0, "all"),))


def released(task, plan):
    found = measure(canonical(record(task, plan).data), TASK_SETTINGS[task]).findings
    return [(item.kind, item.variable, item.question) for item in found]


@pytest.mark.parametrize("task", ["planar", "insertion"])
def test_a_reference_that_moved_unseen_is_found_at_the_release(task):
    """Left or right, so that no epoch's releases lie beside those of the others."""
    assert released(task, JUMPS) == []  # seen to move, it is no fault
    assert released(task, UNSEEN) == [("calibration", "reference", "calibration_residual_m")]
    little = replace(UNSEEN, object_move_m=0.001)
    assert released(task, little) == []


@pytest.mark.parametrize("task", ["planar", "insertion"])
def test_a_hand_that_trembles_misses_by_its_tremor_and_no_reference_has_moved(task):
    assert released(task, Plan(4, episodes=60, tremor_m=0.012)) == []


def test_a_few_releases_elsewhere_are_no_finding():
    data = canonical(record("planar", replace(JUMPS, object_move_m=0.0)).data)
    values = data.observation.copy()
    values[data.episode % 8 == 0, 3] += 0.03
    found = measure(replace(data, observation=values), TASK_SETTINGS["planar"]).findings
    assert not [item for item in found if item.variable == "reference"]
