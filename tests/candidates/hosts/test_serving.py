import numpy as np
import pytest

from genpolicy.candidates.hosts.kinds import read_entry
from genpolicy.candidates.hosts.serving import hosted
from genpolicy.candidates.wire.extension import WORD
from genpolicy.errors import ConfigError, ContractError, IntegrityError
from genpolicy.integrity.hashing import sha256_file
from tests.candidates.hosts.conftest import exported

WIDTHS = {"observation": 24}
SEEN = {"observation": np.ones((2, 24))}


def served(path, **changes):
    return hosted(path, **{"sha256": None, "widths": WIDTHS, **changes})


@pytest.mark.parametrize("kind", ["torch", "onnx", "scripted"])
def test_each_kind_answers(written, kind):
    policy = served(written(kind))
    assert policy.answer(SEEN)["actions"].shape == (16, 10)
    assert policy.metadata["kind"] == kind
    assert policy.metadata["threads"] == 1
    assert policy.metadata[WORD]["counts_evaluations"] is (kind != "scripted")


def test_a_checkpoint_of_ours_is_served_as_by_serve_policy(checkpoint, policy):
    assert served(checkpoint()).metadata[WORD]["checkpoint"] == policy.checkpoint_hash


@pytest.mark.parametrize("kind", ["torch", "onnx", "scripted", "trained"])
def test_another_file_or_another_entry_is_not_hosted(written, kind):
    path = written(kind)
    with pytest.raises(IntegrityError, match="as when it was asked for"):
        served(path, sha256="0" * 64)
    file = path.parent / next(iter(read_entry(path).files))
    file.write_bytes(b"another")
    with pytest.raises(IntegrityError, match="the entry of planted"):
        served(path, sha256=read_entry(path).sha256)


def test_a_weight_that_cannot_be_counted_is_no_count(written):
    for kind in ("torch", "onnx"):
        with pytest.raises(ConfigError, match="cannot be counted"):
            served(written(kind, counted_weight="nothing"))
        said = served(written(kind, counted_weight=None)).metadata[WORD]
        assert said["counts_evaluations"] is False


def test_ports_are_held_against_the_entry_at_the_start(written):
    for kind in ("torch", "onnx"):
        with pytest.raises(ContractError, match=r"float64 \(2, 24\), expected float64 \(2, 25\)"):
            served(written(kind), widths={"observation": 25})


def test_kinds_with_servers_of_their_own_are_not_hosted_here(written):
    with pytest.raises(ConfigError, match=r"trained, torch, onnx, scripted"):
        served(written("lerobot"))


def test_an_encoder_apart_is_run_once_for_all_candidates(written, tmp_path):
    import torch
    from torch import nn

    class Encoder(nn.Module):
        def forward(self, observation):
            return observation.sum(0)[:10]

    class Sampler(nn.Module):
        def forward(self, condition, noise):
            return noise + condition

    data = exported(Encoder(), torch.zeros(2, 24, dtype=torch.float64))
    (tmp_path / "encoder.pt2").write_bytes(data)
    path = written("torch", program="sampler.pt2", counted_weight=None,
                   encoder={"program": "encoder.pt2", "gives": "condition"})  # fmt: skip
    sampler = exported(Sampler(), torch.zeros(10, dtype=torch.float64), torch.zeros(16, 10))
    (tmp_path / "sampler.pt2").write_bytes(sampler)
    files = {name: sha256_file(tmp_path / name) for name in ("encoder.pt2", "sampler.pt2")}
    path = written("torch", program="sampler.pt2", counted_weight=None, files=files,
                   encoder={"program": "encoder.pt2", "gives": "condition"})  # fmt: skip
    policy = served(path)
    assert policy.metadata[WORD]["spans"] == ["preprocess", "encode", "sample"]
    said = {"invocation": "1", "noise": [], "candidates": 2}
    answer = policy.answer({**SEEN, WORD: said})
    assert answer["actions"].shape == (2, 16, 10)
    assert set(answer[WORD]["spans_s"]) == {"preprocess", "encode", "sample"}
