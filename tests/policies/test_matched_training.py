"""Matched training: what may differ between methods, and that everything else is named."""

import shutil

import pytest

from genpolicy.evidence.documents.given import MATCHED
from genpolicy.integrity.atomic import write_bytes
from genpolicy.integrity.documents import canonical_json, read_json
from genpolicy.policies.checkpoint import CONFIG_FILE
from genpolicy.policies.matched_training import (
    TrainingPlan,
    matched_configuration,
    seed_folders,
    train_methods,
)

SINGLE = {
    "horizons.prediction_horizon", "horizons.execution_horizon", "dimensions.prediction_horizon",
}  # fmt: skip


@pytest.fixture
def folders(fleet, kit, tmp_path):
    """Copies of the config files, to be tampered with."""
    found = seed_folders(fleet[0], list(kit.SAMPLERS), 0)
    for method, folder in found.items():
        (tmp_path / method).mkdir()
        shutil.copy(folder / CONFIG_FILE, tmp_path / method / CONFIG_FILE)
    return {method: tmp_path / method for method in found}


def edit(folder, *path, value):
    config = read_json(folder / CONFIG_FILE)
    place = config
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = value
    write_bytes(folder / CONFIG_FILE, canonical_json(config))


def test_matched_methods_differ_in_head_and_sampler_only(folders):
    found = matched_configuration(folders, reference="chunked_bc")
    assert found["differing_keys"]["chunked_bc"] == []
    assert found["differing_keys"]["flow"] == ["method", "sampler.name", "sampler.steps"]
    assert set(found["single_action_keys"]) == SINGLE


def test_gates_read_it_to_the_byte(folders):
    found = matched_configuration(folders, reference="chunked_bc")
    read = MATCHED.parse(found, where=MATCHED.file)
    assert canonical_json(MATCHED.plain(read)) == canonical_json(found)
    assert read.methods["flow"].config.training.updates == found["methods"]["flow"]["config"][
        "training"]["updates"]  # fmt: skip


def test_a_single_action_method_differs_in_its_horizon_by_definition(folders):
    found = matched_configuration(folders, reference="chunked_bc")
    assert found["differing_keys"]["bc"] == ["method"]
    # With the exception's reason gone, the same difference is listed.
    edit(folders["bc"], "horizons", "prediction_horizon", value=8)
    again = matched_configuration(folders, reference="chunked_bc")
    assert set(again["differing_keys"]["bc"]) == {"method", *SINGLE}


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (("training", "updates"), 61),
        (("training", "learning_rate"), 1e-4),
        (("network", "trunk_width"), 64),
        (("provenance", "dataset_manifest_sha256"), "d" * 64),
        (("sampler", "batch_rows"), 32),
        (("training", "mask_padding"), False),
    ],
)
def test_every_other_difference_is_listed(folders, path, value):
    edit(folders["flow"], *path, value=value)
    key = ".".join(path)
    found = matched_configuration(folders, reference="chunked_bc")
    assert key in found["differing_keys"]["flow"]


def test_a_key_that_only_one_side_has_is_listed(folders):
    edit(folders["flow"], "training", "secret_trick", value=True)
    found = matched_configuration(folders, reference="chunked_bc")
    assert "training.secret_trick" in found["differing_keys"]["flow"]


def test_parameters_are_reported_per_part(folders):
    methods = matched_configuration(folders, reference="chunked_bc")["methods"]
    for method in methods.values():
        parts = method["parameters"]
        assert parts["total"] == parts["encoder"] + parts["trunk"] + parts["head"]
    assert methods["flow"]["parameters"]["encoder"] == methods["bc"]["parameters"]["encoder"]


def test_training_again_gives_the_same_checkpoints(fleet, dataset, kit, tmp_path):
    plan = TrainingPlan(
        dataset=dataset, settings=kit.POLICY, horizons=kit.HORIZONS, root_seed=1, device="cpu",
        workers=1, scheduler="local",
    )  # fmt: skip
    again, fixtures = train_methods(plan, {"flow": kit.SAMPLERS["flow"]}, folder=tmp_path)
    assert [(row.method, row.seed, row.row) for row in fixtures] == [
        ("flow", 0, n) for n in range(5)
    ]
    assert {row.checkpoint for row in fixtures} == {again["flow"][0]}
    assert again["flow"] == fleet[1]["flow"]
    assert len({seeds[0] for seeds in fleet[1].values()}) == 3
