"""A million random events: nothing wrong reaches the controller, and the model is awake."""

import pytest
from soak import soak

from genpolicy.evidence.shadow.rig import IMITATED
from genpolicy.execution.checks import without

EVENTS = 250_000


@pytest.mark.parametrize("seed", range(4))
def test_nothing_wrong_reaches_the_controller(seed):
    found = soak(seed, EVENTS)
    assert found.wrongs == []
    assert found.events >= EVENTS and found.commands > EVENTS / 20


@pytest.mark.parametrize(
    ("check", "said"),
    [
        ("continuity", "m from the last command"),
        ("pace", "too soon after the last command"),
        ("stopped", "a command while stopped"),
        ("intervention", "a command while a person commands"),
        ("phase_transition", "of another phase or calibration"),
        ("expired", "later than its validity"),
        ("stale_observation late_chunk", "older than allowed"),
        ("late_chunk", "begins late in contact"),
        ("after_stop", "conditioned before a voiding event"),
    ],
)
def test_without_a_check_the_model_objects(check, said):
    """Each is found by the model or, first, by the checker; alone in its own words."""
    table, seed, wrongs = without(IMITATED, *check.split()), 0, []
    while not any(said in wrong for wrong in wrongs) and seed < 40:
        wrongs += soak(seed, 20_000, table).wrongs
        seed += 1
    assert any(said in wrong for wrong in wrongs), wrongs[:5]


def test_the_same_seed_is_the_same_walk():
    assert soak(3, 2_000) == soak(3, 2_000)
