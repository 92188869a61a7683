"""Data sets of one value: read where they are plain and in the file, passed over where not."""

import h5py
import numpy as np
import pytest

from genpolicy.data.formats.hdf5_single import check_storage, foreign, member, read_single
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


def test_only_what_is_plain_and_inside_is_read(demo):
    rows, single = read_single(demo, {"actions": np.zeros((4, 2))}, [], lambda column: True)
    assert set(rows) == {"obs/flag"}
    assert single == {"word": "left"}
    assert read_single(demo, {"actions": np.zeros((4, 2))}, [], lambda column: False) == ({}, {})


def test_what_reaches_out_of_the_file_is_refused_where_it_is_needed(demo):
    assert foreign(demo["obs/flag"]) is None
    with pytest.raises(ContractError, match="virtual"):
        check_storage(demo["virtual"], "virtual")
    with pytest.raises(ContractError, match="ExternalLink"):
        member(demo, "linked", "demo")
