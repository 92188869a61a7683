"""A quarter of a million random events: nothing wrong is accepted, and the model is awake.

`make soak` is twenty million of them. The walks here are those in which the planted faults are
found, so that the rare moments that a check is for are among so few.
"""

import pytest
from soak import soak

from genpolicy.evidence.shadow.rig import IMITATED
from genpolicy.execution.checks import without

EVENTS, SEARCHED = 40_000, 20_000
PLANTED = [
    ("continuity", "m from the last command", 2),
    ("continuity", "goes on after a hold", 0),
    ("continuity", "where the arm is not", 0),
    ("pace", "too soon after the last command", 43),
    ("stopped", "a command while stopped", 0),
    ("intervention", "a command while a person commands", 1),
    ("phase_transition", "of another phase or calibration", 0),
    ("expired", "later than its validity", 0),
    ("stale_observation late_chunk", "older than allowed", 2),
    ("late_chunk", "begins late in contact", 22),
    ("after_stop", "conditioned before a voiding event", 11),
]
"""Checks that are taken away, what is said of it, and the seed in whose walk it is."""


@pytest.mark.parametrize("seed", sorted({seed for *_, seed in PLANTED}))
def test_nothing_wrong_reaches_the_controller(seed):
    found = soak(seed, EVENTS)
    assert found.wrongs == []
    assert found.events >= EVENTS and found.commands > EVENTS / 20


@pytest.mark.parametrize(("check", "said", "first"), PLANTED)
def test_without_a_check_the_model_objects(check, said, first):
    """Each is found by the model or, first, by the checker; alone in its own words.

    A rare one is found in the walk of one seed of many, so that the search begins with that seed.
    """
    table, wrongs = without(IMITATED, *check.split()), []
    for seed in range(first, first + 40):
        wrongs += soak(seed, SEARCHED, table).wrongs
        if any(said in wrong for wrong in wrongs):
            break
    assert any(said in wrong for wrong in wrongs), wrongs[:5]


def _of_images_alone(check):
    """Of what an event voids, the arm is forgotten: a new image on an old place is new."""
    if not check.name.startswith("after_"):
        return check

    def holds(m):
        event = m.view.voidings.get(check.reason)
        times, arrival = m.chunk.times, m.chunk.arrival
        return event is None or (
            times.condition_ns >= event.before_ns and arrival >= event.arrivals
        )

    return check._replace(holds=holds)


def test_the_model_objects_to_an_old_place_of_the_arm_under_a_new_image():
    wrongs = soak(0, SEARCHED, tuple(map(_of_images_alone, IMITATED))).wrongs
    assert any("an arm before a voiding event" in wrong for wrong in wrongs)
    assert any("checker: P1.void" in wrong for wrong in wrongs)


def test_the_same_seed_is_the_same_walk():
    assert soak(3, 2_000) == soak(3, 2_000)
