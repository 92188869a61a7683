"""The adapter itself, with stand-ins for LeRobot's classes and the questions of a recording."""

import importlib.util
import json
import os
import sys
import types
from pathlib import Path

import msgpack
import numpy as np
import pytest
import torch

from genpolicy.candidates.wire.extension import capabilities, read_answer
from genpolicy.candidates.wire.packing import unpack

ROOT = Path(__file__).parents[2]
RECORDED = ROOT / "tests" / "candidates" / "wire" / "recorded"
INPUTS = ("observation.environment_state", "observation.state")
ROWS, COLUMNS = 16, 10


class Network(torch.nn.Module):
    def forward(self, batch):
        return sum(batch[name].sum() for name in INPUTS)


class Encoder(torch.nn.Module):
    def forward(self, batch):
        return batch


class Act(torch.nn.Module):
    """One evaluation of one network, with an encoder inside."""

    name, evaluations = "act", 1

    def __init__(self):
        super().__init__()
        self.model = Network()
        self.model.encoder = Encoder()
        self.seen, self.forgot = [], 0

    def reset(self):
        self.forgot += 1

    def predict_action_chunk(self, batch):
        self.seen.append({name: tuple(batch[name].shape) for name in INPUTS})
        self.model.encoder.forward(batch)
        mean = self.model.forward(batch)
        return mean + torch.randn(1, ROWS, COLUMNS)


class Diffusion(Act):
    """As many evaluations as denoising steps."""

    name, evaluations = "diffusion", 8

    def __init__(self):
        super().__init__()
        self.diffusion = types.SimpleNamespace(
            unet=Network(), _prepare_global_conditioning=lambda batch: batch
        )

    def predict_action_chunk(self, batch):
        self.seen.append({name: tuple(batch[name].shape) for name in INPUTS})
        self.diffusion._prepare_global_conditioning(batch)
        for _ in range(self.evaluations):
            mean = self.diffusion.unet.forward(batch)
        return mean + torch.randn(1, ROWS, COLUMNS)


POLICIES = {"act": Act, "diffusion": Diffusion}


@pytest.fixture
def adapter(monkeypatch):
    """The module, as LeRobot's own interpreter would load it."""
    config = types.ModuleType("lerobot.configs.policies")
    factory = types.ModuleType("lerobot.policies.factory")

    class PreTrainedConfig:
        @staticmethod
        def from_pretrained(folder):
            said = json.loads((folder / "config.json").read_text())
            return types.SimpleNamespace(**said, input_features=dict.fromkeys(INPUTS))

    def get_policy_class(kind):
        policy = POLICIES[kind]
        policy.from_pretrained = classmethod(lambda cls, folder, config: cls())
        return policy

    config.PreTrainedConfig = PreTrainedConfig
    factory.get_policy_class = get_policy_class
    factory.make_pre_post_processors = lambda *args, **kwargs: (dict, lambda chunk: chunk)
    for name in ("lerobot", "lerobot.configs", "lerobot.policies"):
        monkeypatch.setitem(sys.modules, name, types.ModuleType(name))
    monkeypatch.setitem(sys.modules, "lerobot.configs.policies", config)
    monkeypatch.setitem(sys.modules, "lerobot.policies.factory", factory)
    monkeypatch.setenv("HF_HUB_OFFLINE", "0")  # given back behind the test
    place = ROOT / "adapters" / "lerobot_server.py"
    spec = importlib.util.spec_from_file_location("lerobot_server", place)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(params=sorted(POLICIES))
def kind(request):
    return request.param


@pytest.fixture
def served(adapter, kind, tmp_path):
    (tmp_path / "config.json").write_text(
        json.dumps({"type": kind, "n_obs_steps": 2 if kind == "diffusion" else 1})
    )
    (tmp_path / "model.safetensors").write_bytes(b"weights")
    return adapter.Served(tmp_path, "cpu")


@pytest.fixture
def asked(kind):
    """What our client asked LeRobot's own code, to the byte."""
    recorded = msgpack.unpackb((RECORDED / f"lerobot_{kind}.msgpack").read_bytes())
    return [exchange["asked"] for exchange in recorded["exchanges"]]


def answered(adapter, served, data):
    """Through the adapter's own reading and writing of bytes."""
    message = msgpack.unpackb(data, object_hook=adapter.unpacked)
    return msgpack.packb(served.answer(message), default=adapter.packed)


def test_nothing_is_fetched_beside_the_folder(adapter):
    assert os.environ["HF_HUB_OFFLINE"] == "1"


def test_it_is_read_as_it_reads(adapter, served, kind, asked):
    told = capabilities(unpack(msgpack.packb(served.metadata)))
    assert told.seeded and told.counts_evaluations
    assert {str(term) for term in told.spans} == {"preprocess", "encode", "sample"}
    found = read_answer(
        unpack(answered(adapter, served, asked[0])), key="actions", told=told, invocation="0",
        candidates=2,
    )  # fmt: skip
    assert found.actions.shape == (2, ROWS, COLUMNS)
    assert found.evaluations == POLICIES[kind].evaluations
    assert all(seconds >= 0.0 for seconds in found.spans_s.values())


def test_a_history_of_two_has_an_axis_of_its_own(adapter, served, kind, asked):
    answered(adapter, served, asked[0])
    [shapes] = {tuple(sorted(seen.items())) for seen in served.policy.seen}
    widths = dict(zip(INPUTS, (14, 10), strict=True))
    expected = {name: (1, 2, n) if kind == "diffusion" else (n,) for name, n in widths.items()}
    assert dict(shapes) == expected


def test_noise_is_drawn_by_its_name_and_by_nothing_else(adapter, served, asked):
    first, second = (answered(adapter, served, data) for data in asked)
    torch.manual_seed(5)
    again = [unpack(answered(adapter, served, data)) for data in reversed(asked)][::-1]
    for before, now in zip((first, second), again, strict=True):
        np.testing.assert_array_equal(unpack(before)["actions"], now["actions"])
    one, other = again[0]["actions"]
    assert not np.array_equal(one, other)
    assert not np.array_equal(again[0]["actions"], again[1]["actions"])
    # Each chunk begins where nothing was planned before: LeRobot's policies keep a queue.
    assert served.policy.forgot == 2 * len(asked) * len(again[0]["actions"])


def test_a_plain_message_gets_one_chunk(served, asked, adapter):
    message = msgpack.unpackb(asked[0], object_hook=adapter.unpacked)
    del message["genpolicy"]
    answer = served.answer(message)
    assert set(answer) == {"actions"} and answer["actions"].shape == (ROWS, COLUMNS)


def test_its_identity_is_every_file_of_the_policy_and_no_other(adapter, served, tmp_path):
    before = adapter.digest(tmp_path)
    (tmp_path / "train_config.json").write_text("{}")
    (tmp_path / "README.md").write_text("notes")
    assert adapter.digest(tmp_path) == before == served.checkpoint
    (tmp_path / "model.safetensors").write_bytes(b"other weights")
    changed = adapter.digest(tmp_path)
    (tmp_path / "policy_preprocessor.json").write_text("{}")
    assert len({before, changed, adapter.digest(tmp_path)}) == 3


def test_a_policy_of_another_type_is_not_counted(adapter, tmp_path):
    POLICIES["other"] = Act
    try:
        (tmp_path / "config.json").write_text(json.dumps({"type": "other"}))
        served = adapter.Served(tmp_path, "cpu")
    finally:
        del POLICIES["other"]
    assert served.network is served.encoder is None
    told = served.metadata["genpolicy"]
    assert not told["counts_evaluations"] and told["spans"] == ["preprocess", "sample"]
