"""Replay buffers: a small one made here, and the real PushT recordings where they are present."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
import zarr

from genpolicy.data.contract import SplitRule
from genpolicy.data.dataset import load_dataset
from genpolicy.data.formats.collect import import_source
from genpolicy.data.formats.zarr_buffer import PUSHT, open_source
from genpolicy.errors import BadInputError, ContractError

REAL = Path(__file__).parents[4] / "shared/data/pusht_v7/pusht_cchi_v7_replay.zarr"


def ingest(path, *, out):
    import_source(open_source(path), PUSHT, out=out, split=SplitRule())


@pytest.fixture
def buffer(tmp_path):
    rng = np.random.default_rng(0)
    state = rng.uniform(100, 400, (60, 5)).astype("f4")
    state[:, 4] = rng.uniform(0, 6.28, 60)
    path = tmp_path / "small.zarr"
    group = zarr.open_group(str(path), mode="w", zarr_format=2)
    arrays = {
        "data/state": state,
        "data/action": state[:, :2] + 1,
        "meta/episode_ends": np.array([10, 22, 37, 60], dtype="i8"),
    }
    for name, values in arrays.items():
        chunk = (16, values.shape[1]) if values.ndim == 2 else values.shape
        group.create_array(name, data=values, chunks=chunk)
    return path


def test_small_buffer(buffer, tmp_path):
    ingest(buffer, out=tmp_path / "out")
    dataset = load_dataset(tmp_path / "out")
    assert dataset.frames.action.shape == (60, 2)
    assert dataset.frames.observation.shape == (60, PUSHT.observation.dim)
    assert dataset.manifest["action_contract"]["units"] == ["px", "px"]
    assert set(dataset.frames.phase) == {"all"}
    for name in ("operator", "calibration_epoch", "outcome"):
        assert set(dataset.episodes[name]) == {"not_recorded"}
    assert dataset.episodes["is_recovery"].isna().all()
    with pytest.raises(ContractError, match="only_success=False"):
        dataset.windows("train", 2, 16)
    assert dataset.windows("train", 2, 16, only_success=False).actions.shape[1:] == (16, 2)


def test_missing_chunk_is_not_read_as_zeros(buffer, tmp_path):
    (buffer / "data" / "state" / "1.0").unlink()
    with pytest.raises(ContractError, match="expected all 4"):
        ingest(buffer, out=tmp_path / "out")
    assert not (tmp_path / "out").exists()


def edit(buffer, **changes):
    path = buffer / "data" / "state" / ".zarray"
    head = json.loads(path.read_text())
    path.write_text(json.dumps({**head, **changes}))


@pytest.mark.parametrize(
    "changes",
    [
        {"dtype": "|O"},
        {"filters": [{"id": "pickle"}]},
        {"compressor": {"id": "pickle"}},
        {"shape": [10**9, 5]},
        {"shape": [-1, 5]},
        {"shape": "x"},
        {"zarr_format": 3},
        {"dtype": None},
    ],
)
def test_descriptions_that_are_refused_before_decoding(buffer, tmp_path, changes):
    edit(buffer, **changes)
    with pytest.raises(BadInputError, match="state"):
        ingest(buffer, out=tmp_path / "out")


@pytest.mark.parametrize("name", ["compressor", "filters"])
def test_a_codec_that_runs_code_is_named_before_it_is_asked_for(buffer, tmp_path, name):
    edit(buffer, **{name: {"id": "pickle"} if name == "compressor" else [{"id": "pickle"}]})
    with pytest.raises(ContractError, match="expected plain numbers"):
        ingest(buffer, out=tmp_path / "out")


def test_changed_chunk_and_missing_array(buffer, tmp_path):
    chunk = buffer / "data" / "state" / "0.0"
    chunk.write_bytes(chunk.read_bytes()[:20])
    with pytest.raises(BadInputError, match="state"):
        ingest(buffer, out=tmp_path / "out")
    shutil.rmtree(buffer / "data" / "action")
    with pytest.raises(BadInputError):
        ingest(buffer, out=tmp_path / "out")
    with pytest.raises(BadInputError, match="missing"):
        ingest(tmp_path / "nowhere.zarr", out=tmp_path / "out")


def rewrite(buffer, name, values):
    zarr.open_array(str(buffer / name), mode="r+", zarr_format=2)[...] = values


def test_bad_episodes_are_refused_by_name(buffer, tmp_path):
    state = np.array(zarr.open_array(str(buffer / "data/state"), mode="r")[...])
    state[12, 2] = np.nan
    state[40, 0] = 90000.0
    rewrite(buffer, "data/state", state)
    with pytest.raises(ContractError, match="2 accepted episodes"):
        ingest(buffer, out=tmp_path / "out")
    rewrite(buffer, "meta/episode_ends", np.array([5, 10, 22, 60]))
    with pytest.raises(ContractError, match="2 accepted"):
        ingest(buffer, out=tmp_path / "out")
    state[40, 0] = 100.0
    rewrite(buffer, "data/state", state)
    ingest(buffer, out=tmp_path / "out")
    listed = json.loads((tmp_path / "out" / "refusals.json").read_text())
    assert [item["file"] for item in listed["refused"]] == ["small.zarr#episode_000002"]
    assert "row 2, column state[2] is nan" in listed["refused"][0]["reason"]


@pytest.mark.parametrize("ends", [[10, 22, 37, 61], [10, 10, 37, 60], [22, 10, 37, 60]])
def test_episode_ends(buffer, tmp_path, ends):
    rewrite(buffer, "meta/episode_ends", np.array(ends))
    with pytest.raises(ContractError, match="episode_ends"):
        ingest(buffer, out=tmp_path / "out")


@pytest.mark.skipif(not REAL.is_dir(), reason="PushT recordings are not on this machine")
def test_pusht(tmp_path):
    """Golden: 206 episodes and 25,650 rows at 10 Hz (data/README of the recordings)."""
    ingest(REAL, out=tmp_path / "out")
    dataset = load_dataset(tmp_path / "out")
    assert len(dataset.episodes) == 206
    assert len(dataset.frames) == 25_650
    assert dataset.episodes["rows"].min() == 49
    assert dataset.episodes["rows"].max() == 246
    assert dataset.manifest["counts"]["refused"] == 0
    assert np.abs(dataset.normalisation.action.normalise(dataset.frames.action)).max() < 1.2
