"""One factor at a time: what is measured of each variant, and on which rows."""

import numpy as np
import pyarrow.parquet as pq
import pytest

from genpolicy.candidates.judged import trained
from genpolicy.errors import ConfigError
from genpolicy.evidence.documents.given import VARIANTS as VARIANTS_READ
from genpolicy.evidence.need.factors import FactorPlan, write_factors
from genpolicy.integrity.documents import canonical_json, read_json
from genpolicy.policies.matched_training import TrainingPlan
from genpolicy.policies.settings import SamplerConfig
from genpolicy.policies.variants import Variant, train_variants

SAMPLERS = {
    "bc": SamplerConfig(name="direct"),
    "chunked_bc": SamplerConfig(name="direct"),
    "act": SamplerConfig(name="z_zero"),
    "ibc": SamplerConfig(name="derivative_free", steps=2, population=16),
}
VARIANTS = {
    "reference": Variant(factor="reference"),
    "linear_encoder": Variant(factor="representation", encoder="linear"),
    "longer_history": Variant(factor="representation", observation_horizon=3),
    "transformer": Variant(factor="trunk", trunk="transformer"),
    "act_head": Variant(factor="head", method="act"),
    "energy_head": Variant(factor="head", method="ibc"),
    "single_action": Variant(factor="temporal", method="bc"),
}


def measure(variants, folder, *, dataset, audit, kit):
    """Train and measure variants below one folder."""
    shorter = {"updates": 10, "validation_every": 10}
    training = kit.POLICY.training.model_copy(update=shorter)
    plan = TrainingPlan(
        dataset=dataset, settings=kit.POLICY.model_copy(update={"training": training}),
        horizons=kit.HORIZONS, root_seed=2, device="cpu", workers=1, scheduler="local",
    )  # fmt: skip
    train_variants(plan, variants, SAMPLERS, folder=folder)
    study = FactorPlan(
        task="tabletop_insertion", dataset=dataset, audit=audit, horizons=kit.HORIZONS,
        feasibility=kit.FEASIBILITY, variants=variants, samplers=SAMPLERS,
        conventions={"act": {"z_prior": SamplerConfig(name="z_prior")}}, samples=3, stride=16,
        confidence=0.95,
    )  # fmt: skip
    checkpoints = trained(folder, variants, seeds=[0], device="cpu")
    write_factors(study, checkpoints, folder, workers=1, scheduler="local")


@pytest.fixture(scope="module")
def audit(data, kit, tmp_path_factory):
    rows = [(name, 4, {}) for name in kit.uuids(data)[7:]]
    return kit.write_situations(tmp_path_factory.mktemp("audit"), rows)


@pytest.fixture(scope="module")
def measured(dataset, audit, kit, tmp_path_factory):
    folder = tmp_path_factory.mktemp("factors")
    measure(VARIANTS, folder, dataset=dataset, audit=audit, kit=kit)
    return folder


def frame(folder, name):
    return pq.read_table(folder / f"{name}.parquet").to_pandas()


def test_each_variant_changes_only_its_factor(measured):
    found = read_json(measured / "variants.json")
    read = VARIANTS_READ.read(measured)  # as gates read it, to the byte
    assert canonical_json(VARIANTS_READ.plain(read)) == canonical_json(found)
    assert found["reference"] == read.reference == "reference"
    for name, item in found["variants"].items():
        assert set(item["changed"]) <= set(item["allowed"]), name
        assert bool(item["changed"]) == (name != "reference")
    assert found["variants"]["transformer"]["changed"] == ["network.trunk"]
    assert found["variants"]["single_action"]["prediction_horizon"] == 1


def test_two_factors_at_once_are_seen(dataset, audit, kit, tmp_path):
    both = Variant(factor="trunk", trunk="transformer", encoder="linear")
    variants = {"reference": VARIANTS["reference"], "both": both}
    measure(variants, tmp_path, dataset=dataset, audit=audit, kit=kit)
    item = read_json(tmp_path / "variants.json")["variants"]["both"]
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
    measure(some, tmp_path, dataset=dataset, audit=audit, kit=kit)
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
        measure(variants, tmp_path, dataset=dataset, audit=audit, kit=kit)


def test_a_variant_without_any_sampler_is_refused(dataset, audit, kit, tmp_path):
    variants = {
        "reference": VARIANTS["reference"],
        "l1": Variant(factor="head", method="chunked_l1"),
    }
    with pytest.raises(ConfigError, match=r"variants\.l1 is without a sampler"):
        measure(variants, tmp_path, dataset=dataset, audit=audit, kit=kit)


def test_steps_are_equal_for_all(measured):
    configs = [read_json(measured / name / "seed_0" / "config.json") for name in VARIANTS]
    assert {config["training"]["updates"] for config in configs} == {10}
    assert read_json(measured / "variants.json")["updates"] == 10
