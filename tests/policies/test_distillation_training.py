"""ManiCM trained: the two-mode toy in one step, the checkpoint, and what it needs of a teacher."""

import dataclasses
import json
import shutil

import numpy as np
import pytest
import torch

from genpolicy.errors import ConfigError, ContractError, IntegrityError
from genpolicy.evidence.documents.given import MATCHED, DistilledConfig
from genpolicy.integrity.atomic import write_bytes
from genpolicy.integrity.documents import canonical_json, read_json
from genpolicy.policies.checkpoint import CONFIG_FILE, load_checkpoint
from genpolicy.policies.matched_training import (
    TrainingPlan,
    matched_configuration,
    seed_folders,
    train_methods,
)
from genpolicy.policies.methods import METHODS
from genpolicy.policies.objectives import SquaredError
from genpolicy.policies.policy import load_policy
from genpolicy.policies.settings import HeadConfig, SamplerConfig
from genpolicy.policies.training import train
from genpolicy.statistics.intervals import clopper_pearson

DRAWN = 400
ONE_STEP = SamplerConfig(name="multistep_consistency")


@pytest.fixture(scope="module")
def toy(tmp_path_factory, two_mode_windows, request_for):
    """A trained teacher and its student, of the toy on which one step of plain flow collapses."""
    root, windows = tmp_path_factory.mktemp("toy"), two_mode_windows(1024)
    for method, source in (("diffusion", None), ("manicm", root / "diffusion")):
        request = request_for(method, updates=500)
        train(root / method, request, windows=windows, weights_of=source)
    return root


@pytest.fixture(scope="module")
def shares(toy):
    """Interval of the share of each mode, and of what lies between them, of samples drawn."""

    def draw(method, *, steps):
        name = METHODS[method].samplers[0]
        policy = load_policy(toy / method, sampler=SamplerConfig(name=name, steps=steps))
        samples = policy.sample(np.zeros((1, 2, 3)), noise_names=[("toy",)], candidates=DRAWN)
        assert samples.nfe == steps
        first = samples.actions[0, :, 0, 0]
        return {
            place: clopper_pearson(int((np.abs(first - at) < 0.5).sum()), DRAWN, 0.99)
            for place, at in (("left", -1.0), ("between", 0.0), ("right", 1.0))
        }

    return draw


@pytest.mark.parametrize("steps", [1, 2])
def test_one_step_keeps_both_modes(shares, steps):
    """Held to the same shares as FlowPolicy on this toy."""
    found = shares("manicm", steps=steps)
    assert found["left"][0] > 0.25 and found["right"][0] > 0.25
    assert found["between"][1] < 0.3


def test_what_the_toy_must_tell_one_step_of_the_teacher_leaves_the_modes(shares):
    """And sixteen do not: what the student says at once is what the teacher walks to."""
    one, many, student = (
        shares(method, steps=steps)["between"]
        for method, steps in (("diffusion", 1), ("diffusion", 16), ("manicm", 1))
    )
    assert one[0] > 0.2
    assert many[1] < 0.05
    assert student[1] < one[0]


def test_a_student_leads_where_its_teacher_walks(toy):
    """From the same noise, not only to the same shares: the flow is what was distilled."""
    names, ends = [("same",)], {}
    for method, steps in (("diffusion", 100), ("manicm", 1)):
        sampler = SamplerConfig(name=METHODS[method].samplers[0], steps=steps)
        policy = load_policy(toy / method, sampler=sampler)
        # Noise is named by the checkpoint; under the teacher's name both start alike.
        checkpoint = dataclasses.replace(
            policy.checkpoint, sha256=load_checkpoint(toy / "diffusion").sha256
        )
        alike = type(policy)(checkpoint, sampler=sampler)
        drawn = alike.sample(np.zeros((1, 2, 3)), noise_names=names, candidates=DRAWN)
        ends[method] = drawn.actions[0, :, :, 0].mean(axis=1) > 0
    agreed = int((ends["diffusion"] == ends["manicm"]).sum())
    assert clopper_pearson(agreed, DRAWN, 0.99)[0] > 0.8


def test_the_checkpoint_names_its_teacher_and_what_both_trainings_took(toy):
    teacher, student = (load_checkpoint(toy / name) for name in ("diffusion", "manicm"))
    said = student.config.distilled
    assert said.teacher == "diffusion" and said.teacher_sha256 == teacher.sha256
    windows = 500 * 128
    # by hand: the teacher's update has one evaluation of a window, the student's three
    assert said.updates == 1000
    assert said.evaluations == 4 * windows and said.gradients == 2 * windows
    assert student.config.parameters == teacher.config.parameters
    # teacher and target, which no deployment holds
    assert student.config.training_only_parameters == 2 * teacher.config.parameters["total"]
    assert json.loads((toy / "manicm" / CONFIG_FILE).read_text())["distilled"]["updates"] == 1000
    assert "distilled" not in json.loads((toy / "diffusion" / CONFIG_FILE).read_text())


@pytest.mark.parametrize(("method", "teacher"), [("manicm", None), ("diffusion", "diffusion")])
def test_a_checkpoint_that_hides_or_invents_a_teacher_is_refused(toy, tmp_path, method, teacher):
    shutil.copytree(toy / method, tmp_path / "copy")
    config = read_json(toy / method / CONFIG_FILE)
    said = read_json(toy / "manicm" / CONFIG_FILE)["distilled"]
    config.pop("distilled", None)
    config |= {"distilled": said} if teacher else {}
    write_bytes(tmp_path / "copy" / CONFIG_FILE, canonical_json(config))
    with pytest.raises(IntegrityError, match=f"{method} with the teacher {teacher}"):
        load_checkpoint(tmp_path / "copy")


def test_the_same_seed_gives_the_same_bytes_and_another_teacher_others(
    tmp_path, two_mode_windows, request_for
):
    windows, request = two_mode_windows(1024), request_for("manicm", updates=20)
    for name, teacher_windows in (
        ("one", windows),
        ("two", windows),
        ("other", two_mode_windows()),
    ):
        teacher = tmp_path / f"{name}_teacher"
        train(teacher, request_for("diffusion", updates=20), windows=teacher_windows)
        torch.manual_seed(len(name))
        train(tmp_path / name, request, windows=windows, weights_of=teacher)
    one, two, other = (
        (tmp_path / name / "model.safetensors").read_bytes() for name in ("one", "two", "other")
    )
    assert one == two and one != other
    assert load_checkpoint(tmp_path / "one").sha256 == load_checkpoint(tmp_path / "two").sha256


def test_without_a_teacher_or_with_another_s_nothing_is_trained(
    folders, tmp_path, two_mode_windows, request_for
):
    windows = two_mode_windows()
    with pytest.raises(ConfigError, match="no checkpoint of its teacher"):
        train(tmp_path / "x", request_for("manicm"), windows=windows)
    head = HeadConfig(latent_dim=4, posterior_width=16, prediction="x0")
    for change, teacher, wrong in (
        ({}, folders["flow"], "method"),
        ({"updates": 21}, folders["diffusion"], "training"),
        ({"seed": 4}, folders["diffusion"], "training_seed"),
        ({"head": head}, folders["diffusion"], "head"),
    ):
        with pytest.raises(IntegrityError, match=f"a teacher with another .*{wrong}"):
            request = request_for("manicm", **change)
            train(tmp_path / "x", request, windows=windows, weights_of=teacher)
    with pytest.raises(ContractError, match="expected none"):
        SquaredError().learn_from(None, None)
    assert not (tmp_path / "x").exists()


@pytest.fixture
def plan(dataset, kit):
    return TrainingPlan(
        dataset=dataset, settings=kit.POLICY, horizons=kit.HORIZONS, root_seed=1, device="cpu",
        workers=1, scheduler="local",
    )  # fmt: skip


def test_a_stage_without_the_teacher_is_refused(plan, tmp_path):
    with pytest.raises(ConfigError, match="without diffusion, expected diffusion, the teacher"):
        train_methods(plan, {"manicm": ONE_STEP}, folder=tmp_path / "x")


def test_a_student_is_trained_behind_its_teacher_and_differs_as_methods_may(plan, tmp_path):
    samplers = {"manicm": ONE_STEP, "diffusion": SamplerConfig(name="ddim", steps=4)}
    hashes, fixtures = train_methods(plan, samplers, folder=tmp_path / "x")
    assert set(hashes) == set(samplers) and {row.method for row in fixtures} == set(samplers)
    folders = seed_folders(tmp_path / "x", list(samplers), 0)
    said = read_json(folders["manicm"] / CONFIG_FILE)["distilled"]
    assert said["teacher_sha256"] == hashes["diffusion"][0]
    assert read_json(folders["manicm"] / "training.json")["stopping_rule"] == (
        "fixed number of updates"
    )
    found = matched_configuration(folders, reference="diffusion")
    assert found["differing_keys"]["manicm"] == ["method", "sampler.name", "sampler.steps"]
    # And gates read it, to the byte.
    read = MATCHED.parse(found, where=MATCHED.file)
    assert canonical_json(MATCHED.plain(read)) == canonical_json(found)
    config = read.methods["manicm"].config
    assert isinstance(config, DistilledConfig) and config.distilled.teacher == "diffusion"
    assert not isinstance(read.methods["diffusion"].config, DistilledConfig)
