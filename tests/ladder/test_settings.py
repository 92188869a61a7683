"""Settings that only make sense together, found by the stage or by the gate that needs both."""

import json
from pathlib import Path

import pytest
from ladder_workspace import edit_params, hashes, repro, run_stage


def test_more_sampler_steps_than_training_levels_is_a_bad_setting(copy: Path) -> None:
    def too_many(params: dict) -> None:
        levels = params["policy"]["head"]["diffusion_levels"]
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


@pytest.mark.parametrize(("key", "value"), [("planned_starts", 4), ("margin", -0.8)])
def test_a_plan_other_than_the_run_leaves_gate_d_without_a_verdict(
    copy: Path, key: str, value: float
) -> None:
    edit_params(copy, lambda params: params["gate_d"].update({key: value}))
    outcome, ran = repro(copy)
    assert (outcome.code, outcome.stage, ran) == (3, "card", ["gate_d", "card"])
    assert "Gate D refuses" in outcome.sentence
    report = json.loads((copy / "reports" / "gate_d.json").read_text())
    assert report["verdict"] == "INCONCLUSIVE"
    assert not (copy / "artifacts" / "card").exists()


def test_a_promotion_limit_below_one_over_alpha_is_a_bad_setting(copy: Path) -> None:
    def lenient(params: dict) -> None:
        params["gate_d"]["thresholds"]["promotion_e_value"]["limit"] = 1.0

    edit_params(copy, lenient)
    outcome, _ = repro(copy)
    assert (outcome.code, outcome.stage) == (2, "gate_d")
    assert "promotion_e_value.limit is 1, expected at least 1 / alpha = 2.5" in outcome.sentence
    assert not (copy / "artifacts" / "gate_d").exists(), "no verdict is left of the old limit"
