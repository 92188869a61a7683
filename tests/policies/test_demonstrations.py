"""Demonstrations of one mode, and the numbers of an observation that name the phase."""

from dataclasses import replace

import numpy as np
import pytest

from genpolicy.errors import ConfigError
from genpolicy.integrity.documents import read_json
from genpolicy.policies.checkpoint import CONFIG_FILE
from genpolicy.policies.demonstrations import episodes_of_one_mode, phase_columns
from genpolicy.policies.matched_training import (
    ONE_MODE_KEYS,
    TrainingPlan,
    matched_configuration,
    seed_folders,
    train_methods,
    training_windows,
)
from genpolicy.policies.settings import SamplerConfig

DIRECT = SamplerConfig(name="direct")


def training_episodes(data):
    return sorted(data.episodes["episode_uuid"][data.episodes["split"] == "train"])


@pytest.fixture
def plan(dataset, data, kit):
    training = training_episodes(data)
    modes = {name: ("m1" if k < 2 else "m0") for k, name in enumerate(training[:5])}
    return TrainingPlan(
        dataset=dataset, settings=kit.POLICY, horizons=kit.HORIZONS, root_seed=1, device="cpu",
        workers=1, scheduler="local", followed=modes,
    )  # fmt: skip


def test_the_mode_that_most_training_episodes_followed_is_kept(data):
    training = training_episodes(data)
    held_out = sorted(set(data.episodes["episode_uuid"]) - set(training))
    modes = dict.fromkeys(training[:2], "m0") | dict.fromkeys(training[2:5], "m1")
    # Held-out episodes have no say, however many they are.
    found = episodes_of_one_mode(modes | dict.fromkeys(held_out, "m0"), data)
    assert found == training[2:5]
    even = dict.fromkeys(training[:2], "m1") | dict.fromkeys(training[2:4], "m0")
    assert episodes_of_one_mode(even, data) == training[2:4]
    assert episodes_of_one_mode({}, data) == training


def test_only_their_windows_are_trained_on(data, kit):
    chosen = training_episodes(data)[:2]
    some = training_windows(data, "train", kit.HORIZONS, episodes=chosen)
    frames = sum(
        int(rows) for uuid, rows in zip(data.episodes["episode_uuid"], data.episodes["rows"],
                                        strict=True) if uuid in chosen
    )  # fmt: skip
    assert len(some.observations) == frames
    whole = training_windows(data, "train", kit.HORIZONS)
    assert frames < len(whole.observations)
    assert {row.tobytes() for row in some.actions} <= {row.tobytes() for row in whole.actions}


def test_one_mode_differs_in_its_demonstrations_by_definition_and_nobody_else_may(plan, tmp_path):
    root = tmp_path / "trained"
    train_methods(plan, {"chunked_bc": DIRECT, "one_mode_bc": DIRECT}, folder=root)
    folders = seed_folders(root, ["chunked_bc", "one_mode_bc"], 0)
    found = matched_configuration(folders, reference="chunked_bc")
    assert found["differing_keys"]["one_mode_bc"] == ["method"]
    summaries = {name: read_json(folder / "training.json") for name, folder in folders.items()}
    assert summaries["one_mode_bc"]["windows"] < summaries["chunked_bc"]["windows"]
    assert summaries["one_mode_bc"]["updates"] == summaries["chunked_bc"]["updates"]
    # The same subset under another name is a difference that the gate sees.
    path = folders["one_mode_bc"] / CONFIG_FILE
    path.write_text(path.read_text().replace('"one_mode_bc"', '"chunked_l1"'))
    again = matched_configuration(folders, reference="chunked_bc")
    assert set(ONE_MODE_KEYS) < set(again["differing_keys"]["one_mode_bc"])


def test_without_an_audit_nobody_says_which_mode(plan, data):
    with pytest.raises(ConfigError, match="no word of the modes"):
        replace(plan, followed=None).episodes(data, "one_mode_bc")
    assert plan.episodes(data, "chunked_bc") is None


def test_noise_needs_the_policy_whose_weights_it_takes_over(plan, tmp_path):
    with pytest.raises(ConfigError, match="without chunked_bc"):
        train_methods(plan, {"bc_noise": SamplerConfig(name="offset")}, folder=tmp_path / "x")


def test_noise_is_made_behind_its_policy_in_any_order_of_the_methods(plan, data, tmp_path):
    samplers = {"bc_noise": SamplerConfig(name="offset"), "chunked_bc": DIRECT}
    hashes, fixtures = train_methods(plan, samplers, folder=tmp_path / "x")
    assert set(hashes) == set(samplers) and {row.method for row in fixtures} == set(samplers)
    summary = read_json(tmp_path / "x/bc_noise/seed_0/training.json")
    assert summary["stopping_rule"] == "weights of chunked_bc"
    folders = seed_folders(tmp_path / "x", list(samplers), 0)
    found = matched_configuration(folders, reference="chunked_bc")
    assert found["differing_keys"]["bc_noise"] == ["method", "sampler.name"]


def test_the_phase_is_found_in_the_contract(data):
    columns = phase_columns(data)
    assert len(columns) == len(data.manifest["phases"])
    named = data.frames.observation[:, list(columns)]
    assert np.array_equal(named.sum(axis=1), np.ones(len(named)))
    order = data.manifest["observation_contract"]["channels"][-1]["components"]
    assert [order[k] for k in named.argmax(axis=1)] == data.frames.phase.tolist()
