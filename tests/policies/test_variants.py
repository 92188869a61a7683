"""Variants of one reference: what each factor may change, and samplers that must be there."""

import pytest

from genpolicy.errors import ConfigError
from genpolicy.policies.settings import SamplerConfig
from genpolicy.policies.variants import FACTOR_KEYS, Variant, isolation, reference_of, resolved

DIRECT, EULER = SamplerConfig(name="direct"), SamplerConfig(name="euler", steps=4)


def config(**network):
    return {
        "method": "chunked_bc", "parameters": {"total": 7},
        "network": {"encoder": "mlp", "trunk": "mlp", **network},
        "horizons": {"prediction_horizon": 16},
    }  # fmt: skip


def test_a_variant_brings_its_sampler_or_takes_that_of_the_baseline():
    variants = {"plain": Variant(factor="reference"),
                "flow": Variant(factor="head", method="flow", sampler=EULER)}  # fmt: skip
    found = resolved(variants, {"chunked_bc": DIRECT})
    assert found["plain"] == (variants["plain"], DIRECT) and found["flow"][1] is EULER
    with pytest.raises(ConfigError, match="no baseline is chunked_bc"):
        resolved(variants, {"bc": DIRECT})


@pytest.mark.parametrize("count", [0, 2])
def test_exactly_one_variant_is_the_reference(count):
    variants = {f"r{n}": Variant(factor="reference") for n in range(count)}
    variants["trunk"] = Variant(factor="trunk", trunk="transformer")
    with pytest.raises(ConfigError, match=f"{count} references"):
        reference_of(variants)
    assert reference_of({"one": Variant(factor="reference")}) == "one"


def test_a_second_factor_shows_as_a_key_that_is_not_allowed():
    variants = {
        "base": Variant(factor="reference"), "trunk": Variant(factor="trunk"),
        "both": Variant(factor="trunk"),
    }  # fmt: skip
    configs = {"base": config(), "trunk": config(trunk="transformer"),
               "both": config(trunk="transformer", encoder="linear")}  # fmt: skip
    document = isolation(variants, configs, "base")
    rows = document["variants"]
    assert document["reference"] == "base" and rows["base"]["changed"] == []
    assert set(rows["trunk"]["changed"]) <= set(rows["trunk"]["allowed"])
    assert set(rows["both"]["changed"]) - set(rows["both"]["allowed"]) == {"network.encoder"}
    assert rows["trunk"]["parameters"] == {"total": 7}
    assert rows["trunk"]["prediction_horizon"] == 16


def test_no_two_factors_may_change_the_same_key_but_the_method():
    shared = [key for keys in FACTOR_KEYS.values() for key in keys]
    assert {key for key in shared if shared.count(key) > 1} <= {"method"}
