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


def test_candidates_share_alpha_in_equal_parts():
    settings = StressSettings(**PLAIN)
    assert settings.alpha_of_each(1) == 0.05
    assert settings.alpha_of_each(4) * 4 == pytest.approx(0.05)


@pytest.mark.parametrize(
    "change",
    [{"starts": 0}, {"episode_limit_s": 0.0}, {"samples": 0}, {"alpha": 0.0}, {"alpha": 1.0},
     {"planned_effect": [0.5, 0.6]}, {"planned_effect": [0.5, 1.1]}, {"planned_effect": [0.5]},
     {"perturbations": {"nominal": {"kind": "earthquake"}}},
     {"perturbations": {"earthquake": {}}}, {"perturbations": {"nominal": None}}, {"retries": 3}],
)  # fmt: skip
def test_what_is_out_of_range_or_unknown_is_refused(change):
    with pytest.raises(ValidationError):
        StressSettings(**{**PLAIN, **change})


def test_the_ladder_s_own_section_fits(kit):
    assert StressSettings(**kit.PARAMS["stress"]).starts >= 1
