"""Settings that only make sense together, found by the stage or by the gate that needs both."""

from pathlib import Path

import pytest
from ladder_workspace import edit_params, hashes, repro, run_stage, set_limit

from genpolicy.policies.settings import HeadConfig


def test_more_sampler_steps_than_training_levels_is_a_bad_setting(copy: Path) -> None:
    def too_many(params: dict) -> None:
        levels = HeadConfig().diffusion_levels
        params["train_generators"]["samplers"]["diffusion"]["steps"] = levels + 1

    edit_params(copy, too_many)
    before = hashes(copy, "artifacts", "reports", leave=("artifacts/train_generators/",))
    code, said = run_stage(copy, "train_generators")
    assert code == 2, said
    assert said.startswith("train_generators: ") and "101" in said and "100" in said
    assert hashes(copy, "artifacts", "reports") == before


def test_a_sampler_of_another_method_is_a_bad_setting(copy: Path) -> None:
    def swapped(params: dict) -> None:
        params["train_generators"]["samplers"]["flow"] = {"name": "ddim", "steps": 4}

    edit_params(copy, swapped)
    code, said = run_stage(copy, "train_generators")
    assert code == 2, said
    assert said.startswith("train_generators: ") and "ddim" in said


@pytest.mark.parametrize(("key", "value"), [("starts", 4), ("margin", -0.8)])
def test_a_plan_other_than_the_run_is_not_judged(copy: Path, key: str, value: float) -> None:
    edit_params(copy, lambda params: params["stress"].update({key: value}))
    code, said = run_stage(copy, "gate_d")
    assert code == 2, said
    assert "params.yaml: stress is other than recorded" in said
    assert not (copy / "reports" / "gate_d.json").exists()


def test_a_promotion_limit_of_ones_own_is_a_bad_setting(copy: Path) -> None:
    set_limit(copy, "gate_d", "promotion_e_value", 1.0)
    outcome, _ = repro(copy)
    assert (outcome.code, outcome.stage) == (2, "gate_d")
    assert "promotion_e_value is 1.0, expected `derived`" in outcome.sentence
    assert not (copy / "artifacts" / "gate_d").exists(), "no verdict is left of the old limit"
