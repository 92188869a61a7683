"""Reading an observation never raises; what it does not say is not allowed."""

import json
import math

import numpy as np
import pytest

from genpolicy.evidence.shadow.rig import Rig
from genpolicy.execution.moment import View
from genpolicy.execution.observed import FARTHEST_M, Observed, distance_of

NOW_NS = 10**9


EMPTY = View()


def read(event_time_s, phase="approach", epoch="e", view=EMPTY, **more):
    return Observed.of(view, NOW_NS, event_time_s, phase, epoch, **more)


def test_what_is_said_is_kept():
    told = read(0.9)
    assert told == Observed(900_000_000, "approach", "e", "")
    assert told.payload() == {
        "event_time_ns": 900_000_000, "phase": "approach", "calibration_epoch": "e", "used": True,
        "ignored_because": "", "divergence_m": None, "tcp_m": [],
    }  # fmt: skip
    assert read(0.9, divergence_m=0.02).payload()["divergence_m"] == 0.02
    assert read(0.9, tcp_m=np.array([1.0, 2, 3])).payload()["tcp_m"] == [1.0, 2.0, 3.0]


@pytest.mark.parametrize(
    "none", [None, 3.0, "abc", [0.0, 1.0], [0.0] * 4, [[0.0], [1.0], [2.0]], [0.0, math.nan, 1.0],
             [0.0, math.inf, 1.0], [0.0, "x", 1.0], object(), {}],
)  # fmt: skip
def test_what_is_no_place_is_nowhere(none):
    told = read(0.9, tcp_m=none)
    assert told.tcp_m is None and told.payload()["tcp_m"] == []


@pytest.mark.parametrize("time_s", [math.nan, math.inf, None, "0.9", 1e300, 1.0 + 1e-9])
def test_a_time_that_is_none_or_to_come_is_of_the_future(time_s):
    told = read(time_s)
    assert told.event_ns == NOW_NS + 1 and told.ignored == "future"
    assert told.payload()["used"] is False


def test_an_older_one_is_ignored_and_an_equal_one_is_not():
    view = View(newest_observation_ns=500_000_000)
    assert read(0.499, view=view).ignored == "older" and read(0.5, view=view).ignored == ""


@pytest.mark.parametrize("name", [None, 3, b"e", ["e"], {}])
def test_what_is_no_name_names_nothing(name):
    told = read(0.9, phase=name, epoch=name)
    assert (told.phase, told.calibration_epoch) == ("", "")


def test_a_distance_is_a_number_that_any_file_can_hold():
    """None where nobody says; what is none of a distance is the largest that there is."""
    assert distance_of(None) is None and distance_of(np.float32(0.25)) == 0.25
    for none in (-1e-9, math.nan, math.inf, -math.inf, "0.01", 1j, [0.0], 10**400):
        assert distance_of(none) == FARTHEST_M
    assert type(distance_of(0)) is float and json.dumps(FARTHEST_M, allow_nan=False)


@pytest.mark.parametrize("near", [None, 0.0, 0, 0.05, np.float32(0.01)])
def test_a_distance_within_its_limit_voids_nothing(near):
    assert _accepted_after(near) == 2


@pytest.mark.parametrize(
    "far", [math.nextafter(0.05, 1.0), -1e-9, math.nan, math.inf, -math.inf, "0.01", 1j, [0.0]]
)
def test_a_distance_beyond_it_or_none_voids_what_was_made_before(far):
    assert _accepted_after(far) == 0


def _accepted_after(divergence_m):
    rig = Rig()
    rig.run(2)
    rig.observe(divergence_m=divergence_m)
    before = rig.stub.accepted
    rig.tick(2)
    return rig.stub.accepted - before
