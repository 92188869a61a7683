"""The comparison is registered before it runs: strict, and alpha is shared by the candidates."""

import pytest
from pydantic import ValidationError

from genpolicy.evidence.stress.settings import StressSettings

PLAIN = {
    "starts": 10, "episode_limit_s": 20.0, "samples": 2, "baselines": ["bc"],
    "perturbations": {"nominal": {"kind": "nominal"}}, "margin": 0.1, "alpha": 0.05,
    "planned_effect": [0.5, 0.8],
}  # fmt: skip


def test_a_perturbation_that_names_no_kind_is_of_its_name():
    named = {"nominal": {}, "camera_delay": {"magnitude_s": 0.1}, "later": {"kind": "nominal"}}
    found = StressSettings(**{**PLAIN, "perturbations": named}).perturbations
    assert {name: item.kind for name, item in found.items()} == {
        "nominal": "nominal", "camera_delay": "camera_delay", "later": "nominal",
    }  # fmt: skip


@pytest.mark.parametrize("name", ["nominal", "recovery_drill", "envelope"])
def test_no_condition_has_the_name_of_one_that_gate_d_asks_less_or_more_of(name):
    """The drill is not asked for its fallback: under its name a delay was not asked for it."""
    late = {"kind": "camera_delay", "probability": 1.0, "magnitude_s": 0.08}
    named = {**PLAIN["perturbations"], "later": late}
    assert StressSettings(**{**PLAIN, "perturbations": named})
    with pytest.raises(ValidationError, match=f"`{name}` is the name of"):
        StressSettings(**{**PLAIN, "perturbations": {**PLAIN["perturbations"], name: late}})


@pytest.mark.parametrize("kind", ["nominal", "recovery_drill"])
def test_a_condition_of_such_a_kind_may_have_another_name_and_is_asked_as_all_are(kind):
    named = {**PLAIN["perturbations"], "again": {"kind": kind}}
    assert StressSettings(**{**PLAIN, "perturbations": named}).perturbations["again"].kind == kind


def test_blocks_are_off_unless_they_are_planned():
    assert StressSettings(**PLAIN).block is None
    assert StressSettings(**PLAIN, block=4).block == 4


def test_candidates_share_alpha_in_equal_parts():
    settings = StressSettings(**PLAIN)
    assert settings.alpha_of_each(1) == 0.05
    assert settings.alpha_of_each(4) * 4 == pytest.approx(0.05)


@pytest.mark.parametrize(
    "change",
    [{"block": 0}, {"block": 2.5},
     {"starts": 0}, {"episode_limit_s": 0.0}, {"samples": 0}, {"alpha": 0.0}, {"alpha": 1.0},
     {"planned_effect": [0.5, 0.6]}, {"planned_effect": [0.5, 1.1]}, {"planned_effect": [0.5]},
     {"perturbations": {"nominal": {"kind": "earthquake"}}},
     {"perturbations": {"earthquake": {}}}, {"perturbations": {"nominal": None}}, {"retries": 3}],
)  # fmt: skip
def test_what_is_out_of_range_or_unknown_is_refused(change):
    with pytest.raises(ValidationError):
        StressSettings(**{**PLAIN, **change})


def test_the_ladder_s_own_section_fits(kit):
    assert StressSettings(**kit.PARAMS["stress"]).starts >= 1


LATE = {
    "camera_delay": {"probability": 1.0, "magnitude_s": 0.08},
    "envelope": {"workspace_lower_m": [0.0] * 3, "workspace_upper_m": [1.0] * 3,
                 "speed_limit_m_s": 0.4},
}  # fmt: skip


def graded(**grades):
    planned = {**PLAIN["perturbations"], **LATE}
    return StressSettings(**{**PLAIN, "perturbations": planned, "severities": grades})


def test_a_graded_condition_is_run_and_the_planned_one_stays_the_judged_one():
    settings = graded(camera_delay={"field": "magnitude_s", "values": [0.04, 0.08, 0.16]})
    assert list(settings.perturbations) == ["nominal", "camera_delay", "envelope"]
    found = {name: one.model_dump().get("magnitude_s") for name, one in settings.conditions.items()}
    assert found == {
        "nominal": None, "camera_delay": 0.08, "envelope": None, "camera_delay@0.04": 0.04,
        "camera_delay@0.16": 0.16,
    }  # fmt: skip
    assert [tuple(vars(row).values()) for row in settings.severity_rows] == [
        ("camera_delay@0.04", "camera_delay", "magnitude_s", 0.04),
        ("camera_delay", "camera_delay", "magnitude_s", 0.08),
        ("camera_delay@0.16", "camera_delay", "magnitude_s", 0.16),
    ]
    plain = StressSettings(**PLAIN)
    assert plain.conditions == plain.perturbations and plain.severity_rows == []


@pytest.mark.parametrize(
    ("name", "field", "values", "said"),
    [
        ("camera_delay", "magnitude_s", [0.04, 0.16], "judged size"),
        ("camera_delay", "magnitude_s", [0.08], "at least 2"),
        ("camera_delay", "magnitude_s", [0.16, 0.08], "rise"),
        ("camera_delay", "magnitude_s", [0.08, 0.08], "rise"),
        ("camera_delay", "magnitude_s", [0.0, 0.08], "greater than 0"),
        ("camera_delay", "probability", [1.0, 1.5], "less than or equal to 1"),
        ("camera_delay", "force_n", [0.04, 0.08], "no size of a planned condition"),
        ("camera_delay", "kind", [0.04, 0.08], "no size of a planned condition"),
        ("push", "force_n", [5.0, 15.0], "no size of a planned condition"),
        ("envelope", "speed_limit_m_s", [0.2, 0.4], "no size of a planned condition"),
        ("camera_delay", "magnitude_s", [0.08, 0.16, 0.160000001], "unique"),
    ],
)
def test_a_grade_that_is_none_is_refused(name, field, values, said):
    with pytest.raises(ValidationError, match=said):
        graded(**{name: {"field": field, "values": values}})
