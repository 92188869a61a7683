"""Reading an observation never raises; what it does not say is not allowed."""

import math

import numpy as np
import pytest

from genpolicy.execution.moment import View
from genpolicy.execution.observed import Observed, too_far

NOW_NS = 10**9


EMPTY = View()


def read(event_time_s, phase="approach", epoch="e", view=EMPTY):
    return Observed.of(view, NOW_NS, event_time_s, phase, epoch)


def test_what_is_said_is_kept():
    told = read(0.9)
    assert told == Observed(900_000_000, "approach", "e", "")
    assert told.payload() == {
        "event_time_ns": 900_000_000, "phase": "approach", "calibration_epoch": "e", "used": True,
        "ignored_because": "",
    }  # fmt: skip


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


def test_a_distance_is_within_its_limit_or_too_far():
    assert not too_far(None, 0.05)
    for near in (0.0, 0, 0.05, np.float32(0.01)):
        assert not too_far(near, 0.05)
    for far in (math.nextafter(0.05, 1.0), -1e-9, math.nan, math.inf, -math.inf, "0.01", 1j, [0.0]):
        assert too_far(far, 0.05)
