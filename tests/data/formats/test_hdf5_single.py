"""Data sets of one value: read where they are plain and in the file, passed over where not."""

import h5py
import numpy as np
import pytest

from genpolicy.data.formats import source
from genpolicy.data.formats.hdf5_single import (
    MODEL,
    NO_VALUE,
    attributes_of,
    check_storage,
    foreign,
    member,
    read_single,
)
from genpolicy.data.formats.source import NOT_READABLE, TOO_LARGE
from genpolicy.errors import ContractError


@pytest.fixture
def demo(tmp_path):
    with h5py.File(tmp_path / "other.hdf5", "w") as other:
        other["x"] = np.zeros(4)
    with h5py.File(tmp_path / "a.hdf5", "w") as file:
        group = file.create_group("demo")
        group["obs/flag"] = np.array([0, 0, 1, 1])
        group["word"] = "left"
        group["wide"] = np.zeros((4, 3))
        group["short"] = np.zeros(3)
        group["linked"] = h5py.ExternalLink("other.hdf5", "x")
        group["soft"] = h5py.SoftLink("/demo/word")
        layout = h5py.VirtualLayout(shape=(4,), dtype="f8")
        layout[:] = h5py.VirtualSource(tmp_path / "other.hdf5", "x", shape=(4,))
        group.create_virtual_dataset("virtual", layout)
        yield group


READ = {"actions": np.zeros((4, 2))}


def test_only_what_is_plain_and_inside_is_read(demo):
    found = read_single(demo, READ, lambda column: True)
    assert set(found.by_row) == {"obs/flag", "wide"}
    assert found.single == {"word": "left", "short": "[0.0, 0.0, 0.0]"}
    assert found.left == {"virtual": NO_VALUE}
    none = read_single(demo, READ, lambda column: False)
    assert (none.by_row, none.single) == ({}, {})


def test_groups_in_groups_and_their_attributes_are_read(demo):
    demo["meta/scene/side"] = "left"
    demo["meta/scene/many"] = np.zeros((3, 2, 2))
    demo["meta/stage"] = np.array([0, 0, 1, 1])
    demo["meta"].attrs["goal"] = np.array([0.0, 1.0])
    demo["meta"].attrs["tags"] = ["fast", "left"]
    demo["meta"].attrs["where"] = demo["word"].ref
    demo["meta/scene/of/more/and/more"] = 1
    demo["next_obs/flag"] = np.array([0, 0, 1, 1])
    demo["meta/again"] = demo["meta"]
    found = read_single(demo, READ, lambda column: True)
    said = {name: text for name, text in found.single.items() if name.startswith("meta/")}
    assert said.pop("meta/again/scene/side") == "left"
    assert {name: text for name, text in said.items() if "again" not in name} == {
        "meta/scene/side": "left", "meta/goal": "[0.0, 1.0]", "meta/tags": '["fast", "left"]',
    }  # fmt: skip
    assert "meta/stage" in found.by_row and "next_obs/flag" not in found.by_row
    assert found.left["meta/where"] == found.left["meta/scene/many"] == NO_VALUE


def test_attributes_are_texts_and_a_model_is_none(demo):
    demo.attrs["num_samples"] = 4
    demo.attrs["model_file"] = "<mujoco>" + "<body/>" * 100
    demo.attrs["goal"] = np.array([1, 0])
    demo.attrs["side"] = np.bytes_(b"left")
    demo.attrs["picture"] = np.zeros(4000)
    demo["model"] = demo.attrs["model_file"]
    assert read_single(demo, READ, lambda column: True).left["model"] == MODEL
    found, left = attributes_of(demo)
    assert found == {"goal": "[1, 0]", "side": "left"}
    assert left == {"model_file": MODEL, "picture": NO_VALUE}


def test_what_is_declared_and_empty_is_named(demo):
    demo.attrs["x"] = h5py.Empty("S1")
    demo["note"] = h5py.Empty("f4")
    assert attributes_of(demo) == ({}, {"x": NO_VALUE})
    found = read_single(demo, READ, lambda column: True)
    assert found.left == {"virtual": NO_VALUE, "note": NO_VALUE}


def test_damage_is_named(demo):
    demo.create_dataset("emb", data=np.ones((4, 8)), chunks=(4, 8), compression="gzip")
    demo["emb"].id.write_direct_chunk((0, 0), b"damaged")
    found = read_single(demo, READ, lambda column: True)
    assert found.left == {"virtual": NO_VALUE, "emb": NOT_READABLE} and "wide" in found.by_row


def test_what_is_too_large_to_read_beside_is_named(demo, monkeypatch):
    monkeypatch.setattr(source, "MAXIMUM_BESIDE_BYTES", 90)
    found = read_single(demo, READ, lambda column: True)
    assert "wide" not in found.by_row and found.left["wide"] == TOO_LARGE
    demo["wider"] = np.zeros((4, 4))
    monkeypatch.setattr(source, "MAXIMUM_BESIDE_BYTES", 24 + 96 + 127)
    assert read_single(demo, READ, lambda column: True).left["wider"] == TOO_LARGE
    monkeypatch.undo()
    assert "wider" in read_single(demo, READ, lambda column: True).by_row


def test_what_reaches_out_of_the_file_is_refused_where_it_is_needed(demo):
    assert foreign(demo["obs/flag"]) is None
    with pytest.raises(ContractError, match="virtual"):
        check_storage(demo["virtual"], "virtual")
    with pytest.raises(ContractError, match="ExternalLink"):
        member(demo, "linked", "demo")
