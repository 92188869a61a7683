"""Probes of the world: each changes something."""

import numpy as np
import pytest

from genpolicy.seeds import stream
from genpolicy.tasks.api import WorldSettings
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
