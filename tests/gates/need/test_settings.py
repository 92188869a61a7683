"""Settings of Gate A: the level of the strata is that of the cause, numbers have one home."""

from pathlib import Path

import evidence
import pytest
import yaml
from asked import asked, settings_of

from gates.need import conditioning
from gates.need.settings import NeedSettings
from genpolicy.errors import ConfigError


def test_the_level_of_the_strata_has_one_home(ladder):
    evidence.edit_table(
        ladder, "audit/strata.parquet",
        lambda f: f.assign(effect=0.8, effect_lower=0.6, p_adjusted=0.03),
    )  # fmt: skip
    assert asked(ladder, conditioning.strata_effect, gate="A").value == 0.8

    def lower(params):
        for questions in params["gate_a"]["cause"].values():
            if "strata_p" in questions:
                questions["strata_p"][0] = 0.01

    evidence.write_params(ladder, lower)
    assert asked(ladder, conditioning.strata_effect, gate="A").value == 0.0


def test_every_remedy_of_gate_a_is_a_baseline_that_gate_d_runs():
    params = yaml.safe_load((Path(__file__).parents[3] / "params.yaml").read_text())
    fields = NeedSettings.model_fields
    remedies = {*fields["remedies"].default, fields["one_mode"].default}
    assert remedies == {"chunked_l1", "one_mode_bc", "bc_noise"}
    assert remedies <= set(params["stress"]["baselines"])
    assert remedies <= set(params["train_baselines"]["samplers"])


def test_the_ladder_s_baselines_and_latent_are_read_from_their_homes(ladder):
    settings = settings_of(ladder, "A")
    assert set(settings.baselines) == {*evidence.BASELINES, *evidence.REMEDIES, evidence.DRAWN}
    assert settings.redraws == evidence.PARAMS["stress"]["samples"]
    assert settings.latent_baseline == "act" and settings.confidence == 0.95


@pytest.mark.parametrize(
    ("change", "match"),
    [(lambda p: p.update(confidence=0.5), "confidence"),
     (lambda p: p.update(confidence=1.0), "confidence"),
     (lambda p: p["stress"].update(samples=0), "params.yaml: stress.samples ")],
)  # fmt: skip
def test_a_setting_on_its_border_is_refused_and_one_inside_is_taken(ladder, change, match):
    evidence.write_params(
        ladder, lambda p: p.update(confidence=0.501) or p["stress"].update(samples=1)
    )
    assert settings_of(ladder, "A").redraws == 1
    evidence.write_params(ladder, change)
    with pytest.raises(ConfigError, match=match):
        settings_of(ladder, "A")


def test_a_remedy_is_measured_with_as_many_samples_as_a_candidate_draws(ladder):
    draws = evidence.PARAMS["stress"]["samples"]

    def measured(samples):
        evidence.write_params(ladder, lambda p: p["measure_baselines"].update(samples=samples))
        return settings_of(ladder, "A").samples

    assert measured(draws) == draws
    with pytest.raises(ConfigError, match=r"measure_baselines\.samples.*as many chances") as told:
        measured(draws - 1)
    assert f"{draws - 1} samples cannot show what {draws} draws" in str(told.value)


@pytest.mark.parametrize("splits", [["train", "test"], ["train"], ["everything"], []])
def test_what_trained_is_never_held_out(ladder, splits):
    evidence.write_params(ladder, lambda params: params["gate_a"].update(held_out_splits=splits))
    with pytest.raises(ConfigError, match=r"gate_a\.held_out_splits"):
        settings_of(ladder, "A")
