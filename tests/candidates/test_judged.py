"""Who is judged: listed from their folders, and refused when their files are others."""

from dataclasses import replace

import pytest
import torch

from genpolicy.candidates.judged import (
    BASELINES,
    GENERATORS,
    compared,
    sampling_by,
    trained,
)
from genpolicy.errors import ConfigError, IntegrityError


def test_checkpoints_are_listed_with_their_identity(fleet):
    root, hashes = fleet
    found = trained(root, ["bc", "flow"], seeds=[0], device="cpu")
    assert [(item.name, item.seed, item.kind) for item in found] == [
        ("bc", 0, "trained"), ("flow", 0, "trained"),
    ]  # fmt: skip
    assert all(item.sha256 == hashes[item.name][0] for item in found)
    assert all(item.load().method == item.name for item in found)


def test_other_files_are_refused(fleet):
    (flow,) = trained(fleet[0], ["flow"], seeds=[0], device="cpu")
    with pytest.raises(IntegrityError, match="sha256"):
        replace(flow, sha256="0" * 64).load()


def test_baselines_come_before_generators_from_their_own_folders(fleet, tmp_path):
    for name in (BASELINES, GENERATORS):
        (tmp_path / name).symlink_to(fleet[0])
    found = compared(tmp_path, baselines=["chunked_bc"], generators=("flow",), seed=0, device="cpu")
    assert [(item.name, item.folder.parents[1].name) for item in found] == [
        ("chunked_bc", BASELINES), ("flow", GENERATORS),
    ]  # fmt: skip


def test_a_method_on_both_sides_is_refused_by_name(fleet, tmp_path):
    """Tables know a method by its name: its rows would be those of two checkpoints."""
    for name in (BASELINES, GENERATORS):
        (tmp_path / name).symlink_to(fleet[0])
    with pytest.raises(ConfigError, match=r"stress\.baselines.*flow, also in train_generators"):
        compared(
            tmp_path, baselines=["chunked_bc", "flow"], generators=["flow"], seed=0, device="cpu"
        )


def test_a_policy_is_loaded_where_it_is_to_run_and_keeps_its_device_under_other_samplers(fleet):
    (flow,) = trained(fleet[0], ["flow"], seeds=[0], device="cpu:0")
    policy = flow.load()
    assert policy.device == "cpu:0"
    assert sampling_by(policy, policy.sampler).device == "cpu:0"


def test_a_device_that_is_not_there_is_a_setting_that_is_wrong(fleet, monkeypatch):
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 0)
    (flow,) = trained(fleet[0], ["flow"], seeds=[0], device="cuda")
    with pytest.raises(
        ConfigError, match=r"compute\.device is 'cuda', which this machine does not"
    ):
        flow.load()
