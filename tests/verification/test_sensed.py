"""When exposures have to arrive: as the clock draws them, and what a journal states otherwise."""

import math

import pytest
from pydantic import TypeAdapter

from genpolicy.contract.latency import DECLARED_TERMS
from genpolicy.evidence.stress.exposures import SENSOR_TERMS
from genpolicy.evidence.stress.perturbations import Perturbation, sensing
from genpolicy.verification.sensed import SENSED, Sensed, sensed_s

MS = 1_000_000
DECLARED = {str(term): (0.001, 0.003) for term in DECLARED_TERMS}
LOTS = [0.0, 0.5, 0.25, 1.0 - 2**-53, 0.4, 0.9]


@pytest.mark.parametrize(
    ("planned", "total_s"),
    [
        ({"kind": "nominal"}, 0.0075),
        ({"kind": "camera_delay", "probability": 0.5, "magnitude_s": 0.08}, 0.0875),
        ({"kind": "camera_delay", "probability": 0.4, "magnitude_s": 0.08}, 0.0075),
        ({"kind": "frame_drop", "probability": 0.5}, math.inf),
        ({"kind": "frame_drop", "probability": 0.3}, 0.0075),
        ({"kind": "network_jitter", "probability": 1.0, "magnitude_s": 0.3}, 0.0075),
    ],
)
def test_by_hand_and_as_the_schedule_says(planned, total_s):
    """1 + 2 + 1.5 + 3 ms, and what hits the camera; the fifth draw decides whether it does."""
    found = sensed_s(planned, DECLARED, LOTS)
    assert list(found) == list(SENSED) == [str(term) for term in SENSOR_TERMS]
    assert sum(found.values()) == pytest.approx(total_s)
    hit = sensing(TypeAdapter(Perturbation).validate_python(planned), falls=LOTS[4], lot=LOTS[5])
    assert hit.dropped == math.isinf(total_s)
    more_s = hit.extra_s.get("capture", 0.0)
    assert more_s == pytest.approx(0.08 if total_s == 0.0875 else 0.0)


TIMES = (0, 50, 100)


def followed(*arrivals, end=150, exposed=TIMES):
    """Two exposures that take 20 ms, and one that never comes; the arrivals of a journal, ms."""
    own = Sensed("x", 3, 50 * MS)
    for t in exposed:
        own.read("exposure", {"t": round(t * MS)})
    for of, t in arrivals:
        own.read("arrived", {"exposed_ns": of * MS, "t": t * MS})
    takes = {0: 0.02, 1: 0.02}
    return own, list(own.otherwise(end * MS, lambda _, start, n: {"all": takes.get(n, math.inf)}))


def test_arrivals_as_planned():
    own, found = followed((0, 20), (50, 70))
    assert found == [] and own.newest == (1, 50 * MS)
    assert followed((0, 20), end=100)[1] == []  # it ended before it could be told
    assert Sensed("x", 3, 50 * MS).newest == (-1, -1)


@pytest.mark.parametrize(
    ("exposed", "said"),
    [
        # The second one, a ns behind a lost first one, would undo its loss.
        ((0, 50, 50 + 1e-6, 150), "exposure 2 is at 50000001 ns"),
        ((0, 50, 100 + 1e-5), "exposure 2 is at 100000010 ns"),
        ((0, 50), "2 exposures until 150000000 ns"),
    ],
)
def test_exposures_at_other_times_than_one_a_period_are_found(exposed, said):
    _, found = followed((0, 20), (50, 70), exposed=exposed)
    assert len(found) == 1 and found[0].startswith(said)


def test_a_period_of_no_whole_ns_is_told_in_whole_ones():
    own = Sensed("x", 3, round(1e9 / 30))
    for number in range(300):
        own.read("exposure", {"t": round(number * 1e9 / 30)})
    assert list(own.otherwise(round(10e9), lambda *_: {"all": math.inf})) == []


@pytest.mark.parametrize(
    ("arrivals", "said"),
    [
        (((0, 20),), "exposure 1 never came"),
        (((0, 20), (50, 69)), "exposure 1 came at 69"),
        (((0, 25), (50, 70)), "exposure 0 came at 25"),
        (((0, 20), (50, 70), (100, 120)), "exposure 2 came at 120"),
    ],
)
def test_what_comes_sooner_later_or_not_is_found(arrivals, said):
    exposed = (*TIMES, 150)
    _, found = followed(*arrivals, end=200, exposed=exposed)
    assert len(found) == 1 and found[0].startswith(said)
