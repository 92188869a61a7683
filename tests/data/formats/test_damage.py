"""Random damage to files of others: a clean refusal or a dataset, never another exception."""

import shutil

import h5py
import numpy as np
import pytest

from genpolicy.data.dataset import load_dataset
from genpolicy.data.formats import open_dataset
from genpolicy.errors import BadInputError
from genpolicy.seeds import stream

CASES = 40


def hdf5(layouts, path):
    with h5py.File(path, "w") as out:
        for i in range(4):
            state, action = layouts.samples(i)
            out[f"data/demo_{i}/actions"] = action
            out[f"data/demo_{i}/obs/pos"] = state
    return path, path


def long_table(layouts, path):
    root = layouts.v3(path, count=4)
    target = root / "data" / "chunk-000" / "file-000.parquet"
    return target, target


def description(layouts, path):
    root = layouts.v2(path, count=4)
    return root, root / "meta" / "info.json"


def episode(layouts, path):
    root = layouts.v2(path, count=4)
    return root, layouts.file(root, 1)


@pytest.mark.parametrize("make", [hdf5, long_table, description, episode])
def test_damage(layouts, tmp_path, make):
    source, victim = make(layouts, tmp_path / ("x.hdf5" if make is hdf5 else "x"))
    whole = victim.read_bytes()
    outcomes = {"dataset": 0, "refused": 0}
    for case in range(CASES):
        rng = stream(3, make.__name__, case)
        damaged = bytearray(whole)
        if case % 4 == 0:
            del damaged[rng.integers(len(damaged)) :]
        for _ in range(int(rng.integers(1, 6)) if damaged else 0):
            damaged[rng.integers(len(damaged))] = rng.integers(256)
        victim.write_bytes(damaged)
        shutil.rmtree(tmp_path / "out", ignore_errors=True)
        try:
            opened = open_dataset(source, out=tmp_path / "out")
        except BadInputError as error:
            outcomes["refused"] += 1
            assert "\n" not in str(error)
            assert not (tmp_path / "out").exists()
            continue
        outcomes["dataset"] += 1
        assert opened.found == opened.accepted + len(opened.refused)
        frames = load_dataset(tmp_path / "out").frames
        assert np.isfinite(frames.observation).all()
    assert outcomes["refused"] + outcomes["dataset"] == CASES
    assert outcomes["refused"] > 0 or make is episode
