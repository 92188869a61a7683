"""Checkpoints: round trip, and every kind of damage refused with exit code 2."""

import json
import pickle
import shutil
import struct
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors.torch import load, save

from genpolicy.errors import IntegrityError
from genpolicy.integrity.documents import canonical_json
from genpolicy.integrity.hashing import sha256_bytes
from genpolicy.policies.checkpoint import load_checkpoint


@pytest.fixture
def copy(folders, tmp_path) -> Path:
    return Path(shutil.copytree(folders["flow"], tmp_path / "copy"))


def replace_weights(folder: Path, data: bytes) -> None:
    """Other weights under a config that names their hash: what a hash check alone lets pass."""
    (folder / "model.safetensors").write_bytes(data)
    config = json.loads((folder / "config.json").read_bytes())
    config["weights_sha256"] = sha256_bytes(data)
    (folder / "config.json").write_bytes(canonical_json(config))


def change_config(folder: Path, **changes: object) -> None:
    config = json.loads((folder / "config.json").read_bytes())
    (folder / "config.json").write_bytes(canonical_json({**config, **changes}))


def refused(folder: Path, text: str, **arguments: str) -> None:
    with pytest.raises(IntegrityError, match=text) as caught:
        load_checkpoint(folder, **arguments)
    assert caught.value.exit_code == 2


def tensors(folder: Path) -> dict[str, torch.Tensor]:
    return load((folder / "model.safetensors").read_bytes())


def test_round_trip(folders):
    for folder in folders.values():
        checkpoint = load_checkpoint(folder)
        assert (
            load_checkpoint(folder, expected_sha256=checkpoint.sha256).sha256 == checkpoint.sha256
        )
        stored = tensors(folder)
        for name, value in checkpoint.network.state_dict().items():
            assert torch.equal(value, stored[name])
        assert not any("posterior" in name for name in stored)
        record = json.loads((folder / "training.json").read_text())
        assert record["checkpoint_sha256"] == checkpoint.sha256


def test_the_posterior_of_act_is_counted_apart(folders):
    assert load_checkpoint(folders["act"]).config.training_only_parameters > 0
    assert load_checkpoint(folders["flow"]).config.training_only_parameters == 0


def test_one_metadata_key_and_no_path_in_the_file(folders):
    data = (folders["bc"] / "model.safetensors").read_bytes()
    length = struct.unpack("<Q", data[:8])[0]
    assert list(json.loads(data[8 : 8 + length])["__metadata__"]) == ["genpolicy"]


def test_every_flipped_byte_is_refused(copy):
    rng = np.random.default_rng(0)
    identity = load_checkpoint(copy).sha256
    for name in ("model.safetensors", "config.json"):
        original = (copy / name).read_bytes()
        for place in rng.integers(0, len(original), 30):
            data = bytearray(original)
            data[place] ^= 1 << int(rng.integers(0, 8))
            (copy / name).write_bytes(bytes(data))
            with pytest.raises(IntegrityError):
                load_checkpoint(copy, expected_sha256=identity)
        (copy / name).write_bytes(original)
    assert load_checkpoint(copy).sha256 == identity


def test_a_flipped_weight_is_refused_without_a_known_identity(copy):
    data = bytearray((copy / "model.safetensors").read_bytes())
    data[-1] ^= 1
    (copy / "model.safetensors").write_bytes(bytes(data))
    refused(copy, "sha256")


class Trap:
    """What a hostile pickle does when it is loaded."""

    def __reduce__(self):
        return (Path.touch, (Path("touched_by_a_checkpoint"),))


def test_a_pickle_is_refused_and_not_run(copy, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    for data in (pickle.dumps(Trap()), b"", b"\x80\x04"):
        replace_weights(copy, data)
        refused(copy, "not safetensors")
    torch.save({"state": torch.zeros(3)}, copy / "zip")
    replace_weights(copy, (copy / "zip").read_bytes())
    refused(copy, "not safetensors")
    assert not (tmp_path / "touched_by_a_checkpoint").exists()


def test_header_bombs_are_refused(copy):
    replace_weights(copy, struct.pack("<Q", 1 << 63) + b"{}")
    refused(copy, "header length")
    replace_weights(copy, struct.pack("<Q", 2 << 20) + b" " * (2 << 20))
    refused(copy, "header length")
    replace_weights(copy, struct.pack("<Q", 12) + b'{"a":1,"a":2' + b"}")
    refused(copy, "JSON|twice")
    replace_weights(copy, struct.pack("<Q", 2) + b"[]")
    refused(copy, "no object")


def test_wrong_tensors_are_refused(copy):
    good = tensors(copy)
    name = "encoder.out.bias"
    damages = {
        "extra": {**good, "surprise": torch.zeros(1)},
        "missing": {key: value for key, value in good.items() if key != name},
        "F32 of shape": {**good, name: torch.zeros(good[name].shape[0] + 1)},
        r"F32 of shape \[16\]": {**good, name: good[name].double()},
        "not finite": {**good, name: good[name] * torch.nan},
    }
    for text, damaged in damages.items():
        replace_weights(copy, save(damaged))
        refused(copy, text)
    replace_weights(copy, save({**good, name: good[name] / 0.0 * torch.inf}))
    refused(copy, "not finite")


def test_overlapping_tensors_are_refused(copy):
    data = (copy / "model.safetensors").read_bytes()
    length = struct.unpack("<Q", data[:8])[0]
    header = json.loads(data[8 : 8 + length])
    same_shape = ["trunk.first.0.weight", "trunk.first.1.weight"]
    header[same_shape[0]]["data_offsets"] = header[same_shape[1]]["data_offsets"]
    text = json.dumps(header).encode()
    replace_weights(copy, struct.pack("<Q", len(text)) + text + data[8 + length :])
    refused(copy, "gaps or overlaps")


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"method": "os.system"}, "method"),
        ({"format_version": 2}, "format_version"),
        ({"surprise": 1}, "surprise"),
        ({"dimensions": {"observation_horizon": 2, "observation_dim": 3,
                         "prediction_horizon": 4, "action_dim": 3}}, "dimensions"),
        ({"sampler": {"name": "ddim", "steps": 4, "clip": 1.0, "batch_rows": 16}}, "sampler"),
        ({"training_seed": "3"}, "training_seed"),
    ],
)  # fmt: skip
def test_wrong_configs_are_refused(copy, changes, text):
    change_config(copy, **changes)
    refused(copy, text)


def test_a_config_of_another_size_is_refused(copy):
    config = json.loads((copy / "config.json").read_bytes())
    change_config(copy, network={**config["network"], "trunk_width": 64})
    refused(copy, "F32 of shape|missing|extra")


def test_nan_and_double_keys_in_the_config_are_refused(copy):
    text = (copy / "config.json").read_text()
    (copy / "config.json").write_text(text.replace('"training_seed": 3', '"training_seed": NaN'))
    refused(copy, "NaN")
    (copy / "config.json").write_text(
        text.replace('"training_seed": 3', '"training_seed": 3, "training_seed": 4')
    )
    refused(copy, "twice")


def test_links_and_missing_files_are_refused(copy, tmp_path):
    weights = copy / "model.safetensors"
    weights.rename(tmp_path / "elsewhere")
    refused(copy, "not readable")
    weights.symlink_to(tmp_path / "elsewhere")
    refused(copy, "not readable")


def test_another_identity_is_refused(copy):
    refused(copy, "a checkpoint with sha256", expected_sha256="0" * 64)
