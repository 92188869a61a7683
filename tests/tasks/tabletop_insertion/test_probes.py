"""Probes of the world: each changes something."""

import numpy as np
import pytest

from genpolicy.errors import ConfigError
from genpolicy.seeds import stream
from genpolicy.tasks.api import WorldSettings
from genpolicy.tasks.tabletop_insertion.probes import PROBES, find_probe
from genpolicy.tasks.tabletop_insertion.start import sample_start
from genpolicy.tasks.tabletop_insertion.world import TabletopWorld

SETTINGS = WorldSettings("epoch_1")


@pytest.fixture
def start():
    return sample_start(stream(2, "world"))


def test_each_probe_changes_the_world_or_what_is_seen(start):
    nominal = TabletopWorld(start, settings=SETTINGS)
    for probe in ("calibration_shift", "lighting"):
        world = TabletopWorld(start, settings=WorldSettings("epoch_1", probe))
        assert not np.array_equal(world.observe()[14:19], nominal.observe()[14:19])
        assert world.state_sha256() == nominal.state_sha256()
    for probe in ("unseen_object", "contact_anomaly"):
        world = TabletopWorld(start, settings=WorldSettings("epoch_1", probe))
        assert world.model is not nominal.model


def test_severity_one_is_the_probe_and_two_is_twice_as_far():
    for name, probe in PROBES.items():
        assert find_probe(f"{name}@1") == probe
    twice = find_probe("calibration_shift@2")
    assert (twice.camera.x_m, twice.camera.yaw_rad) == (0.006, 0.06)
    assert find_probe("contact_anomaly@2").variant.friction_scale == 4.0
    assert find_probe("unseen_object@0.5").variant.peg_width_scale == pytest.approx(1.075)


@pytest.mark.parametrize("severity", ["0", "-1", "nan", "inf", "much", ""])
def test_a_severity_that_is_none_is_refused(severity):
    with pytest.raises(ConfigError, match="severity of the probe"):
        find_probe(f"lighting@{severity}")
