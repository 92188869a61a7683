"""Any path: which layout it is, where it may be written, what the same data give again."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import zarr

from genpolicy.data.dataset import load_dataset
from genpolicy.data.formats import open_dataset
from genpolicy.errors import BadInputError


def buffer(path, arrays, ends):
    group = zarr.open_group(str(path), mode="w", zarr_format=2)
    for name, values in arrays.items():
        chunks = (16, *values.shape[1:])
        group.create_array(f"data/{name}", data=values, chunks=chunks)
    ends = np.array(ends, dtype="i8")
    group.create_array("meta/episode_ends", data=ends, chunks=ends.shape)
    return path


def test_a_buffer_of_any_width(layouts, tmp_path):
    parts = [layouts.samples(i) for i in range(5)]
    path = buffer(
        tmp_path / "arm.zarr",
        {
            "state": np.concatenate([state for state, _ in parts]),
            "action": np.concatenate([action for _, action in parts]),
            "img": np.zeros((150, 2, 2, 3), "u1"),
        },
        np.arange(1, 6) * 30,
    )
    opened = open_dataset(path, out=tmp_path / "out")
    assert opened.accepted == 5
    assert opened.contract.pairing == {f"action_{i}": f"state.state_{i}" for i in range(3)}
    notes = " ".join(opened.notes)
    assert "Not read: img" in notes
    assert "found in the numbers, not in names" in notes
    assert "could not be guessed: state, action" in notes
    assert "rate was guessed: 10 Hz" in notes
    dataset = load_dataset(tmp_path / "out")
    first = dataset.episodes["source_file"].tolist().index("arm.zarr#episode_000000")
    rows = dataset.frames.episode == first
    np.testing.assert_array_equal(dataset.frames.action[rows], layouts.samples(0)[1])


@pytest.mark.parametrize("place", ["inside", "around", "file", "foreign", "link"])
def test_nothing_is_written_over(layouts, tmp_path, place):
    root = layouts.v2(tmp_path / "a" / "recordings")
    (tmp_path / "file").write_text("x")
    (tmp_path / "foreign").mkdir()
    (tmp_path / "foreign" / "thesis.tex").write_text("x")
    (tmp_path / "link").symlink_to(tmp_path / "foreign")
    out = {"inside": root / "out", "around": tmp_path / "a"}.get(place, tmp_path / place)
    with pytest.raises(BadInputError, match="nothing was removed"):
        open_dataset(root, out=out)
    assert (tmp_path / "foreign" / "thesis.tex").exists()
    assert layouts.file(root, 0).exists()


def test_an_old_dataset_is_replaced(layouts, tmp_path):
    for count in (6, 7):
        layouts.v2(tmp_path / "a", count=count)
        open_dataset(tmp_path / "a", out=tmp_path / "out")
        assert len(load_dataset(tmp_path / "out").episodes) == count


def test_progress_counts_every_episode(layouts, tmp_path):
    calls = []
    root = layouts.v2(tmp_path / "a")
    layouts.file(root, 2).write_bytes(b"")
    open_dataset(root, out=tmp_path / "out", progress=lambda *call: calls.append(call))
    assert calls == [(i, 6) for i in range(1, 7)]


def test_what_the_audit_must_see_is_imported(layouts, tmp_path):
    """Repeated targets and episodes glued to themselves are findings, not faults of the file."""
    folder = tmp_path / "rows"
    folder.mkdir()
    for i in range(6):
        state, action = layouts.samples(i)
        action[8:16] = action[8]
        doubled = [np.concatenate([values, values]) for values in (state, action)]
        table = pa.table({"state": doubled[0].tolist(), "action": doubled[1].tolist()})
        pq.write_table(table, folder / f"{i}.parquet")
    opened = open_dataset(folder, out=tmp_path / "out")
    assert opened.accepted == 6
    frames = load_dataset(tmp_path / "out").frames
    np.testing.assert_array_equal(frames.action[:30], frames.action[30:60])


def test_a_frozen_sensor_is_refused_and_a_resting_object_is_not(layouts, tmp_path):
    root = layouts.v2(tmp_path / "a")
    for i in range(6):
        state, action = layouts.samples(i, 80)
        if i == 3:
            state[20:70] = state[20]
        block = np.full((80, 2), 0.3)
        table = layouts.table(
            i, 80 * i, 80,
            **{
                "observation.state": layouts.vectors(state),
                "action": layouts.vectors(action),
                "observation.block": layouts.vectors(block),
            },
        )  # fmt: skip
        layouts.write(layouts.file(root, i), table)
    opened = open_dataset(root, out=tmp_path / "out")
    assert [r.file for r in opened.refused] == ["data/chunk-000/episode_000003.parquet"]
    assert "state, row 20 is constant for 2.450 s" in opened.refused[0].reason
    frozen = opened.contract.frozen
    assert frozen is not None
    assert frozen.streams == ["state"]
