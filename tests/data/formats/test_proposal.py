"""Proposals of whole datasets."""

import numpy as np
import pytest
import zarr

from genpolicy.data.formats import FORMATS, open_dataset, propose
from genpolicy.errors import BadInputError


def buffer(path, arrays, ends):
    group = zarr.open_group(str(path), mode="w", zarr_format=2)
    for name, values in arrays.items():
        chunks = (16, *values.shape[1:])
        group.create_array(f"data/{name}", data=values, chunks=chunks)
    ends = np.array(ends, dtype="i8")
    group.create_array("meta/episode_ends", data=ends, chunks=ends.shape)
    return path


def test_the_known_buffer_needs_no_guess(tmp_path):
    rng = np.random.default_rng(0)
    state = rng.uniform(100, 400, (60, 5)).astype("f4")
    state[:, 4] = rng.uniform(0, 6.28, 60)
    arrays = {"state": state, "action": state[:, :2] + 1, "n_contacts": state[:, :1]}
    path = buffer(tmp_path / "p.zarr", arrays, [10, 22, 37, 60])
    contract = propose(path)
    assert contract.task == "pusht"
    assert propose(path, task="mine").task == "mine"
    assert not any(channel.guessed for channel in contract.channels)


def test_the_format_must_fit(layouts, tmp_path):
    root = layouts.v2(tmp_path / "a")
    contract = propose(root)
    with pytest.raises(BadInputError, match="--format"):
        open_dataset(root, out=tmp_path / "out", format="rosbag")
    with pytest.raises(BadInputError, match="lerobot"):
        open_dataset(root, out=tmp_path / "out", format="parquet", contract=contract)
    with pytest.raises(BadInputError, match="lerobot"):
        open_dataset(layouts.file(root, 0), out=tmp_path / "out", contract=contract)
    assert set(FORMATS) == {"auto", "mcap", "zarr", "lerobot", "robomimic", "parquet"}
