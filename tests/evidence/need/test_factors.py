"""One factor at a time: what each may change, what is measured, and on which rows."""

import dataclasses

import numpy as np
import pyarrow.parquet as pq
import pytest

from genpolicy.errors import ConfigError
from genpolicy.evidence.need.factors import FactorStudy, Variant, run_factors
from genpolicy.integrity.documents import read_json
from genpolicy.policies.settings import SamplerConfig

VARIANTS = {
    "reference": Variant(factor="reference"),
    "linear_encoder": Variant(factor="representation", encoder="linear"),
    "longer_history": Variant(factor="representation", observation_horizon=3),
    "transformer": Variant(factor="trunk", trunk="transformer"),
    "act_head": Variant(
        factor="head", method="act", sampler=SamplerConfig(name="z_zero"),
        conventions={"z_prior": SamplerConfig(name="z_prior")},
    ),
    "energy_head": Variant(
        factor="head", method="ibc",
        sampler=SamplerConfig(name="derivative_free", steps=2, population=16),
    ),
    "single_action": Variant(factor="temporal", method="bc"),
}  # fmt: skip


def study_of(kit, variants):
    training = kit.POLICY.training.model_copy(update={"steps": 10, "validation_every": 10})
    return FactorStudy(
        task="tabletop_insertion",
        variants=variants,
        settings=kit.POLICY.model_copy(update={"training": training}),
        horizons=kit.HORIZONS,
        feasibility=kit.FEASIBILITY,
        samples=3,
        stride=16,
        root_seed=2,
        device="cpu",
        workers=1,
        scheduler="local",
    )


@pytest.fixture(scope="module")
def audit(data, kit, tmp_path_factory):
    rows = [(name, 4, {}) for name in kit.uuids(data)[7:]]
    return kit.write_situations(tmp_path_factory.mktemp("audit"), rows)


@pytest.fixture(scope="module")
def measured(dataset, audit, kit, tmp_path_factory):
    folder = tmp_path_factory.mktemp("factors")
    run_factors(study_of(kit, VARIANTS), dataset=dataset, audit=audit, folder=folder)
    return folder


def frame(folder, name):
    return pq.read_table(folder / f"{name}.parquet").to_pandas()


def test_each_variant_changes_only_its_factor(measured):
    found = read_json(measured / "factors.json")
    assert found["reference"] == "reference"
    for name, item in found["variants"].items():
        assert set(item["changed"]) <= set(item["allowed"]), name
        assert bool(item["changed"]) == (name != "reference")
    assert found["variants"]["transformer"]["changed"] == ["network.trunk"]
    assert found["variants"]["single_action"]["prediction_horizon"] == 1


def test_two_factors_at_once_are_seen(dataset, audit, kit, tmp_path):
    both = Variant(factor="trunk", trunk="transformer", encoder="linear")
    variants = {"reference": VARIANTS["reference"], "both": both}
    run_factors(study_of(kit, variants), dataset=dataset, audit=audit, folder=tmp_path)
    item = read_json(tmp_path / "factors.json")["variants"]["both"]
    assert sorted(set(item["changed"]) - set(item["allowed"])) == ["network.encoder"]


def test_all_are_measured_on_the_same_rows_and_situations(measured):
    errors, modes = frame(measured, "errors"), frame(measured, "modes")
    kinds = {(v, c) for v, c in zip(errors["variant"], errors["convention"], strict=True)}
    assert len(kinds) == len(VARIANTS) + 1
    assert ("act_head", "z_prior") in kinds
    for table, keys in ((errors, ["split", "episode_uuid", "windows"]), (modes, ["episode_uuid"])):
        seen = {
            pair: tuple(map(tuple, rows[keys].to_numpy().tolist()))
            for pair, rows in table.groupby(["variant", "convention"])
        }
        assert set(seen) == kinds
        assert len(set(seen.values())) == 1
    drawn = modes["convention"].isin(["z_prior", "derivative_free"])
    assert set(modes.loc[drawn, "samples"]) == {3}
    assert set(modes.loc[~drawn, "samples"]) == {1}


def test_effects_are_against_the_reference(measured):
    effects = frame(measured, "effects")
    assert len(effects) == 3 * (len(VARIANTS) + 1)
    own = effects[effects["variant"] == "reference"]
    assert (own["effect"] == 0.0).all()
    single = effects[effects["variant"] == "single_action"]
    assert set(single["measure"]) == {"first_error", "mode_coverage", "valid_share"}
    assert set(effects["measure"]) - {"first_error"} == {
        "chunk_error", "mode_coverage", "valid_share",
    }  # fmt: skip


def test_errors_are_finite_and_one_action_has_one_error(measured):
    errors = frame(measured, "errors")
    assert np.isfinite(errors[["chunk_error", "first_error"]].to_numpy()).all()
    single = errors[errors["variant"] == "single_action"]
    assert np.allclose(single["chunk_error"], single["first_error"])
    other = errors[errors["variant"] == "reference"]
    assert not np.allclose(other["chunk_error"], other["first_error"])


def test_the_same_study_gives_the_same_bytes(measured, dataset, audit, kit, tmp_path):
    some = {name: VARIANTS[name] for name in ("reference", "energy_head")}
    run_factors(study_of(kit, some), dataset=dataset, audit=audit, folder=tmp_path)
    for name in some:
        weights = f"{name}/seed_0/model.safetensors"
        assert (tmp_path / weights).read_bytes() == (measured / weights).read_bytes()
    whole, part = (frame(folder, "errors") for folder in (measured, tmp_path))
    whole = whole[whole["variant"].isin(list(some))].reset_index(drop=True)
    assert whole.equals(part)


@pytest.mark.parametrize("factors", [["trunk"], ["reference", "reference"]])
def test_exactly_one_reference(dataset, audit, kit, tmp_path, factors):
    variants = {str(i): Variant(factor=factor) for i, factor in enumerate(factors)}
    with pytest.raises(ConfigError, match="references"):
        run_factors(study_of(kit, variants), dataset=dataset, audit=audit, folder=tmp_path)


def test_steps_are_equal_for_all(measured, kit):
    configs = [read_json(measured / name / "seed_0" / "config.json") for name in VARIANTS]
    assert {config["training"]["steps"] for config in configs} == {10}
    assert dataclasses.asdict(study_of(kit, VARIANTS))["stride"] == 16
