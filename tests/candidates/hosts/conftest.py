"""A tiny program in both forms, and entries of every kind beside it."""

import copy
import io
import shutil
import zipfile

import onnx
import pytest
import torch
import yaml
from onnx import TensorProto, helper
from torch import nn

from genpolicy.candidates.hosts.kinds import CHECKPOINT_FILES
from genpolicy.integrity.hashing import sha256_bytes, sha256_file
from tests.candidates.conftest import ENTRY

WIDTH, ROWS, COLUMNS = 24, 16, 10
NOISE = {"input": "noise", "shape": [ROWS, COLUMNS]}
PLANNER = """
import numpy as np
def plan(given):
    return np.full((16, 10), given["observation"].sum()) + given.get("noise", 0.0)
"""


class Tiny(nn.Module):
    """Noise, moved twice by the newest observation through one layer."""

    def __init__(self):
        super().__init__()
        torch.manual_seed(0)
        self.layer = nn.Linear(WIDTH, COLUMNS)

    def forward(self, observation, noise):
        x = noise
        for _ in range(2):
            x = x + self.layer(observation[-1].to(torch.float32))
        return x


def exported(module, *inputs):
    stream = io.BytesIO()
    torch.export.save(torch.export.export(module, inputs), stream)
    return stream.getvalue()


def replant(data, changes):
    """The archive with other bytes of some members, or with more of them."""
    members = {}
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        names = archive.namelist()
        root = names[0].partition("/")[0]
        members = {name: archive.read(name) for name in names}
    members |= {f"{root}/{name}": value for name, value in changes.items()}
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for name, value in members.items():
            archive.writestr(name, value)
    return stream.getvalue()


def member(data, name):
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        [found] = [known for known in archive.namelist() if known.partition("/")[2] == name]
        return archive.read(found)


@pytest.fixture(scope="session")
def torch_data():
    """As `torch.export.save` writes it, sample inputs included."""
    seen = torch.zeros(2, WIDTH, dtype=torch.float64)
    return exported(Tiny().eval(), seen, torch.zeros(ROWS, COLUMNS))


def onnx_model(nodes=None, domain="", **outputs):
    """`noise + weight + weight`, or other operators; the observation is looked at by none."""
    nodes = nodes or [
        helper.make_node("Add", ["noise", "weight"], ["moved"]),
        helper.make_node("Add", ["moved", "weight"], ["actions"], domain=domain),
    ]
    weight = helper.make_tensor(
        "weight", TensorProto.FLOAT, [COLUMNS], [float(n) for n in range(10)]
    )
    out = outputs or {"actions": [ROWS, COLUMNS]}
    graph = helper.make_graph(
        nodes, "tiny",
        [
            helper.make_tensor_value_info("observation", TensorProto.DOUBLE, [2, WIDTH]),
            helper.make_tensor_value_info("noise", TensorProto.FLOAT, [ROWS, COLUMNS]),
        ],
        [helper.make_tensor_value_info(own, TensorProto.FLOAT, out[own]) for own in out],
        [weight],
    )  # fmt: skip
    domains = [helper.make_opsetid(name, 20 if not name else 1) for name in {"", domain}]
    return helper.make_model(graph, opset_imports=domains, ir_version=10)


@pytest.fixture(scope="session")
def onnx_data():
    model = onnx_model()
    onnx.checker.check_model(model)
    return model.SerializeToString()


@pytest.fixture
def written(tmp_path, torch_data, onnx_data):
    """A function that writes an entry of a kind, with other fields, and what it names."""
    contents = {
        "torch": {"policy.pt2": torch_data},
        "onnx": {"policy.onnx": onnx_data},
        "scripted": {"planner.py": PLANNER.encode()},
        "trained": {"flow/config.json": b"{}", "flow/model.safetensors": b""},
        "lerobot": {"act/config.json": b"{}", "act/model.safetensors": b"weights"},
    }
    own = {
        "torch": {"program": "policy.pt2", "noise": NOISE, "counted_weight": "layer.weight"},
        "onnx": {"program": "policy.onnx", "noise": NOISE, "counted_weight": "weight"},
        "scripted": {"function": "planner:plan", "stochastic": False},
        "trained": {"checkpoint": "flow"},
        "lerobot": {"pretrained_model": "act"},
    }

    def write(kind, **changes):
        for name, data in contents[kind].items():
            (tmp_path / name).parent.mkdir(exist_ok=True)
            (tmp_path / name).write_bytes(data)
        common = {key: value for key, value in ENTRY.items() if key != "address"}
        files = {name: sha256_bytes(data) for name, data in contents[kind].items()}
        entry = copy.deepcopy({**common, "kind": kind, "files": files, **own[kind], **changes})
        path = tmp_path / f"{kind}.yaml"
        path.write_text(yaml.safe_dump({k: v for k, v in entry.items() if v is not None}))
        return path

    return write


@pytest.fixture
def checkpoint(written, fleet):
    """A function that writes the entry of a trained checkpoint, with other fields."""

    def write(method="flow", **changes):
        path = written("trained")
        place = path.parent / "flow"
        shutil.rmtree(place)
        shutil.copytree(fleet[0] / method / "seed_0", place)
        files = {f"flow/{name}": sha256_file(place / name) for name in CHECKPOINT_FILES}
        entry = {**yaml.safe_load(path.read_text()), "files": files, **changes}
        path.write_text(yaml.safe_dump(entry))
        return path

    return write
