"""Sizes lie between nothing and the largest that is stated, and every condition is searched."""

import pytest

from genpolicy.evidence.failure_search.conditions import searched_conditions
from genpolicy.evidence.rows.stress import NEUTRAL
from genpolicy.evidence.stress.settings import StressSettings
from genpolicy.integrity.documents import read_yaml


@pytest.fixture
def planned(pytestconfig):
    section = dict(read_yaml(pytestconfig.rootpath / "params.yaml")["stress"])

    def make(**changes):
        return {one.of: one for one in searched_conditions(StressSettings(**section | changes))}

    return make


def test_every_judged_condition_is_searched_under_a_name_of_its_own(planned, pytestconfig):
    names = read_yaml(pytestconfig.rootpath / "params.yaml")["stress"]["perturbations"]
    found = planned()
    assert list(found) == list(names)
    assert [one.name for one in found.values()] == [f"{name}@search" for name in names]
    assert not {one.name for one in found.values()} & set(names)


def test_what_has_no_size_is_run_as_planned(planned):
    found = planned()
    for name in ("nominal", "recovery_drill", "envelope"):
        assert (found[name].sizes, found[name].at(None)) == (0, found[name].planned)
        assert found[name].share(None) == 1.0


@pytest.mark.parametrize("name", ["camera_delay", "compute_contention", "queue_reorder", "push"])
def test_sizes_go_from_above_nothing_to_the_judged_one(planned, name):
    one = planned()[name]
    least, most = one.severity(0.0), one.severity(1.0)
    assert NEUTRAL[one.field] < least < most == one.most == getattr(one.planned, one.field)
    assert one.at(most) == one.planned
    assert getattr(one.at(least), one.field) == least
    assert 0 < one.share(least) < 0.02 and one.share(most) == 1.0


def test_a_push_gets_weaker_in_the_open_and_in_contact(planned):
    push = planned()["push"]
    half = push.at(push.planned.force_n / 2)
    assert half.contact_force_n == pytest.approx(push.planned.contact_force_n / 2)


def test_a_stated_curve_says_the_field_and_how_far(planned):
    graded = {"camera_delay": {"field": "magnitude_s", "values": [0.04, 0.08, 0.16]},
              "network_jitter": {"field": "probability", "values": [0.25, 0.5]}}  # fmt: skip
    found = planned(severities=graded)
    assert found["camera_delay"].severity(1.0) == pytest.approx(0.16)
    assert (found["network_jitter"].field, found["network_jitter"].most) == ("probability", 0.5)
