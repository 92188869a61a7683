"""Arrays of a buffer beside the contract: told by their length, read block by block."""

import json

import numpy as np
import pytest
import zarr

from genpolicy.data.formats import source, zarr_arrays
from genpolicy.data.formats.source import TOO_LARGE
from genpolicy.data.formats.zarr_arrays import arrays_below, slices
from genpolicy.data.formats.zarr_beside import Beside, described, lists_of

ENDS = [3, 10, 11, 20]


@pytest.fixture
def root(tmp_path):
    group = zarr.open_group(str(tmp_path / "a"), mode="w", zarr_format=2)
    for name, values in {
        "row": np.arange(20), "wide": np.arange(80.0).reshape(20, 4), "goal": np.eye(4)[:, :2],
        "single": np.arange(4), "other": np.zeros(7), "deep": np.zeros((4, 2, 2)),
    }.items():  # fmt: skip
        group.create_array(name, data=values, chunks=(3, *values.shape[1:]))
    return tmp_path / "a"


def test_arrays_are_told_by_their_length(root):
    found = described(arrays_below(root), rows=20, episodes=4)
    assert (set(found.by_row), set(found.by_episode)) == ({"row", "wide"}, {"goal", "single"})
    assert found.notes() == [
        "Not read: deep (no plain columns).",
        "Not read: other (of another length than the episodes).",
        "Chunks are not there, read as the fill value: goal.",
    ]


@pytest.mark.parametrize("block", [1, 4, 100])
def test_slices_are_the_rows_of_each_episode(root, monkeypatch, block):
    monkeypatch.setattr(zarr_arrays, "BLOCK_ROWS", block)
    parts = list(slices(root / "wide", ENDS))
    assert [len(part) for part in parts] == [3, 7, 1, 9]
    np.testing.assert_array_equal(np.concatenate(parts), np.arange(80.0).reshape(20, 4))


def test_values_by_row_and_by_episode(root):
    found = described(arrays_below(root), rows=20, episodes=4)
    beside = Beside(found, ENDS, read=["row"], also=lambda column: True)
    assert [len(beside.next()["wide"]) for _ in ENDS] == [3, 7, 1, 9]
    assert beside.of_episode(1) == {"goal": "[0.0, 1.0]", "single": "1"}
    none = Beside(found, ENDS, read=[], also=lambda column: False)
    assert (none.next(), none.of_episode(0), none.left) == ({}, {}, {})


def test_what_is_too_large_is_named(root, monkeypatch):
    # An episode of it, 9 rows of 4 numbers, and the blocks that are decoded.
    size = 8 * 9 * 4 + zarr_arrays.largest_block(root / "wide")
    found = described(arrays_below(root), rows=20, episodes=4)
    for spare, left in ((96, {}), (95, {"wide": TOO_LARGE})):  # goal and single hold 96 bytes
        monkeypatch.setattr(source, "MAXIMUM_BESIDE_BYTES", size + spare)
        beside = Beside(found, ENDS, read=["row"], also=lambda column: True)
        assert beside.left == left and set(beside.of_episode(0)) == {"goal", "single"}


def test_attributes_that_list_the_episodes(root):
    attributes = {"side": ["a", "b", "a", "b"], "limits": [1, 2], "unit": "m", "o": [{"k": 1}] * 4}
    (root / ".zattrs").write_text(json.dumps(attributes))
    assert lists_of(root, 4) == {"side": ["a", "b", "a", "b"], "o": ['{"k": 1}'] * 4}
    (root / ".zattrs").write_text('{"side": NaN}')
    assert lists_of(root, 4) == {}
