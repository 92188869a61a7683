"""Admitted chunks, looked at every millisecond by something else; and that it is awake.

`make soak` looks at ten thousand. The chunks here are those among which a sweep that is missing is
found.
"""

import pytest
from dense import KINDS, look

from genpolicy.execution.checks import without
from genpolicy.feasibility.checks import CHECKS

ADMITTED, SEARCHED = 100, 600


def test_nothing_admitted_is_wrong_at_any_millisecond():
    found = look(1, ADMITTED)
    assert found.wrongs == []
    assert found.admitted.total() == ADMITTED and set(found.admitted) == set(KINDS)
    # Looked at is what is next to being refused, by many checks, at speed and close by.
    assert len(found.refused) > 12
    assert found.worst["of a joint's speed"] > 0.95
    assert found.worst["lacking of the clearance, m"] > -0.001


@pytest.mark.parametrize(
    ("gone", "kinds", "said", "seed"),
    [
        (("scene_collision", "swept_collision", "measured_collision"), ("beside",), "post", 0),
        (("swept_collision",), KINDS, "ms: ", 1),
        (("measured_collision",), KINDS, "from where it was", 1),
        (("joint_velocity", "measured_velocity"), ("free", "edge"), "of a joint's speed", 0),
        (("contact_force",), ("down",), " N", 0),
        (("approach_direction",), ("down",), "P6.approach", 0),
        (("gripper_opening",), ("down", "onto"), "P6.release", 1),
    ],
)
def test_without_a_check_it_objects(gone, kinds, said, seed):
    found = look(seed, SEARCHED, without(CHECKS, *gone), kinds=kinds, until=said)
    assert any(said in wrong for wrong in found.wrongs), found.wrongs[:5]


def test_the_same_seed_is_the_same_look():
    assert look(3, 10) == look(3, 10)
