"""How hard a disturbance must be: next to nothing is refused by name, a harder one is free."""

import math

import pytest

from gates.protection import require_protection
from gates.severity import MILDEST, too_mild
from genpolicy.errors import ConfigError
from genpolicy.integrity.documents import read_yaml


def _planned(**conditions):
    return {"stress": {"perturbations": {"nominal": {}, **conditions}}}


@pytest.fixture(autouse=True)
def _any_list(monkeypatch):
    """Here it is asked how hard a condition is, not which there are."""
    monkeypatch.setattr("gates.protection.NAMED", ())


def test_golden_what_is_the_least():
    assert {item.kind: dict(item.least) for item in MILDEST} == {
        "camera_delay": {"probability": 0.5, "magnitude_s": 0.05},
        "compute_contention": {"probability": 0.2, "factor": 2.0},
        "frame_drop": {"probability": 0.05},
        "policy_stall": {"probability": 0.02, "magnitude_s": 0.1},
        "network_jitter": {"probability": 0.2, "magnitude_s": 0.05},
        "queue_reorder": {"probability": 0.02, "magnitude_s": 0.1},
        "push": {"force_n": 5.0},
    }


@pytest.mark.parametrize("mildest", MILDEST, ids=lambda item: item.kind)
def test_a_disturbance_of_next_to_nothing_is_refused_in_each_field(mildest):
    least = dict(mildest.least)
    assert require_protection(_planned(**{mildest.kind: least}), "D") == ()
    for field, value in least.items():
        for bad in (1e-9, value - 1e-6, math.nan, "much", True):
            planned = _planned(**{mildest.kind: {**least, field: bad}})
            with pytest.raises(ConfigError, match=rf"{mildest.kind}\.{field}") as refused:
                require_protection(planned, "D")
            assert mildest.reason in str(refused.value) and refused.value.exit_code == 2
            assert require_protection(planned, "C") == ()
            (said,) = require_protection({**planned, "rehearsal": True}, "D")
            assert f"stress.perturbations: {mildest.kind}" in said


def test_one_condition_of_the_kind_that_hits_is_enough_by_whatever_name():
    mild = {"kind": "camera_delay", "magnitude_s": 0.01}
    hard = {"kind": "camera_delay", "magnitude_s": 0.2}
    assert too_mild(_planned(a=mild, b=hard)) == []
    ((found, text),) = too_mild(_planned(a=mild, b={**mild, "magnitude_s": 0.02}))
    assert found.kind == "camera_delay"
    assert text == "a.magnitude_s: 0.01, least 0.05; b.magnitude_s: 0.02, least 0.05"


@pytest.mark.parametrize("params", [{}, {"stress": 3}, {"stress": {"perturbations": ["nominal"]}}])
def test_what_is_not_planned_is_no_matter_of_this(params):
    assert too_mild(params) == [] == too_mild(_planned(camera_delay={}))


def test_the_shipped_conditions_hit(request):
    assert too_mild(read_yaml(request.config.rootpath / "params.yaml")) == []
