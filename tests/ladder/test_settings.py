"""Settings that only make sense together, found before anything trains or by the gate of both."""

from pathlib import Path

import pytest
from ladder_workspace import edit_params, hashes, repro, run_here, set_limit

from genpolicy.policies.settings import HeadConfig


def test_more_sampler_steps_than_training_levels_is_a_bad_setting(copy: Path) -> None:
    def too_many(params: dict) -> None:
        levels = HeadConfig().diffusion_levels
        params["train_generators"]["samplers"]["diffusion"]["steps"] = levels + 1

    edit_params(copy, too_many)
    before = hashes(copy, "artifacts", "reports")
    code, said = run_here(copy, "task")
    assert code == 2, said
    assert said.startswith("task: ") and "101" in said and "100" in said
    assert hashes(copy, "artifacts", "reports") == before


def test_a_sampler_of_another_method_is_a_bad_setting(copy: Path) -> None:
    def swapped(params: dict) -> None:
        params["train_generators"]["samplers"]["flow"] = {"name": "ddim", "steps": 4}

    edit_params(copy, swapped)
    code, said = run_here(copy, "task")
    assert code == 2, said
    assert said.startswith("task: ") and "ddim" in said


def test_a_method_that_does_not_exist_is_a_bad_setting(copy: Path) -> None:
    def misnamed(params: dict) -> None:
        samplers = params["train_generators"]["samplers"]
        samplers["flou"] = samplers.pop("flow")

    edit_params(copy, misnamed)
    code, said = run_here(copy, "task")
    assert code == 2, said
    assert said.startswith("task: ") and "'flou'" in said and "flow" in said


def test_samplers_other_than_those_judged_are_not_trained(copy: Path) -> None:
    def fewer(params: dict) -> None:
        params["train_generators"]["samplers"]["diffusion"]["steps"] -= 1

    edit_params(copy, fewer)
    code, said = run_here(copy, "train_generators")
    assert code == 3, said
    assert "train_generators.samplers" in said and "as judged" in said


@pytest.mark.parametrize(("key", "value"), [("starts", 4), ("margin", -0.8)])
def test_a_plan_other_than_the_run_is_not_judged(copy: Path, key: str, value: float) -> None:
    edit_params(copy, lambda params: params["stress"].update({key: value}))
    code, said = run_here(copy, "gate_d")
    assert code == 2, said
    assert "params.yaml: stress is other than recorded" in said
    assert not (copy / "reports" / "gate_d.json").exists()


def test_a_promotion_limit_of_ones_own_is_a_bad_setting(copy: Path) -> None:
    set_limit(copy, "gate_d", "promotion_e_value", 1.0)
    outcome, _ = repro(copy)
    assert (outcome.code, outcome.stage) == (2, "gate_d")
    assert "promotion_e_value is 1.0, expected `derived`" in outcome.sentence
    assert not (copy / "artifacts" / "gate_d").exists(), "no verdict is left of the old limit"
