"""The page of methods and samplers lists what is registered, and nothing else."""

import sys
from pathlib import Path

import pytest
import yaml

sys.path.insert(0, str(Path(__file__).parent))

import methods

from genpolicy.policies.evaluations import EVALUATIONS
from genpolicy.policies.methods import METHODS
from genpolicy.policies.settings import SamplerConfig


def test_the_page_lists_what_is_registered() -> None:
    page = methods.PAGE.read_text()
    assert methods.written(page) == page, "run `python tests/contracts/methods.py --write`"


def test_whoever_registers_a_method_or_sampler_stands_on_the_page(monkeypatch) -> None:
    page = methods.PAGE.read_text()
    for name in (*METHODS, *EVALUATIONS):
        assert f"\n| `{name}` |" in page, name
    assert set(methods.NEEDS) == set(EVALUATIONS)
    monkeypatch.delitem(methods.METHODS, "manicm")
    with pytest.raises(IndexError):  # its sampler is of nobody any more
        methods.section()
    monkeypatch.delitem(methods.EVALUATIONS, "multistep_consistency")
    assert methods.written(page) != page


@pytest.mark.parametrize(
    ("sampler", "keys"),
    [("direct", []), ("ddim", ["steps", "clip", "eta"]), ("dpm_2m", ["steps", "clip"]),
     ("heun", ["steps"]), ("bosh3", ["steps", "tolerance", "nfe_cap"]),
     ("langevin", ["steps", "population"]), ("multistep_consistency", ["steps", "clip"])],
)  # fmt: skip
def test_keys_are_those_that_the_check_takes(sampler, keys) -> None:
    """By hand from `SamplerConfig`; every key of it but those of all samplers is of some."""
    assert methods.keys_of(sampler) == keys
    every = {key for name in EVALUATIONS for key in methods.keys_of(name)}
    assert every == set(SamplerConfig.model_fields) - {"name", "batch_rows"}


def test_the_default_of_every_method_is_read_from_the_parameters() -> None:
    params = yaml.safe_load((methods.ROOT / "params.yaml").read_text())
    page = methods.PAGE.read_text()
    for stage, role in (("train_baselines", "baseline"), ("train_generators", "candidate")):
        for name, sampler in params[stage]["samplers"].items():
            assert f"\n| `{name}` | {role}: `{sampler['name']}`" in page
