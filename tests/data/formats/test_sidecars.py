"""Files beside the recordings are named, and never opened."""

import h5py
import numpy as np
import pyarrow.parquet as pq
import pytest
import zarr
from long_tables import rows

from genpolicy.data.formats import propose
from genpolicy.data.formats.opening import open_source
from genpolicy.data.formats.sidecars import of_file, of_folder


def noted(path, kind):
    """The names of the note on what is not read."""
    said = [n for n in open_source(path, kind).notes if n.startswith("Not read, beside")]
    return [note.split(": ")[1].split(". What")[0] for note in said]


def test_beside_tables_of_a_folder(layouts, tmp_path):
    for i in range(2):
        pq.write_table(rows(layouts, i), tmp_path / f"{i}.parquet")
    assert noted(tmp_path, "parquet") == []
    (tmp_path / "more").mkdir()
    for name in ("labels.yaml", "README.md", ".cache", "more/annotations.csv"):
        (tmp_path / name).write_bytes(b"\xff\x00")
    assert noted(tmp_path, "parquet") == ["labels.yaml, more/annotations.csv"]
    assert any("more/annotations.csv" in note for note in propose(tmp_path).notes)


def test_beside_one_table_what_is_called_like_it(layouts, tmp_path):
    path = tmp_path / "pick.parquet"
    pq.write_table(rows(layouts, 0), path)
    for name in ("pick.json", "pick_notes.txt", "picked.csv", "contract.yaml", "pick.hdf5"):
        (tmp_path / name).touch()
    assert noted(path, "parquet") == ["pick.json, pick_notes.txt"]
    assert of_file(tmp_path / "no" / "such.parquet") == ()


@pytest.mark.parametrize("version", ["v2", "v3"])
def test_of_a_lerobot_dataset_its_own_files_are_known(layouts, tmp_path, version):
    root = getattr(layouts, version)(tmp_path / "recordings")
    (root / "videos/chunk-000").mkdir(parents=True)
    own = ("README.md", "meta/stats.json", "videos/chunk-000/a.mp4", ".gitattributes")
    for name in own:
        (root / name).touch()
    assert noted(root, "lerobot") == []
    (root / "meta" / "labels.json").write_text("{")
    pq.write_table(rows(layouts, 0), root / "annotations.parquet")
    assert noted(root, "lerobot") == ["annotations.parquet, meta/labels.json"]


def test_of_zarr_and_hdf5(layouts, tmp_path):
    state, action = layouts.samples(0)
    group = zarr.open_group(str(tmp_path / "arm.zarr"), mode="w", zarr_format=2)
    for name, values in {"data/state": state, "data/action": action}.items():
        group.create_array(name, data=values, chunks=values.shape)
    group.create_array("meta/episode_ends", data=np.array([15, 30]))
    assert noted(tmp_path / "arm.zarr", "zarr") == []
    (tmp_path / "arm.zarr" / "meta" / "sides.json").touch()
    (tmp_path / "arm.csv").touch()
    assert noted(tmp_path / "arm.zarr", "zarr") == ["meta/sides.json", "arm.csv"]
    (tmp_path / "h").mkdir()
    with h5py.File(tmp_path / "h" / "demo.hdf5", "w") as file:
        file["data/demo_0/actions"], file["data/demo_0/obs/state"] = action, state
    (tmp_path / "h" / "who.yaml").touch()
    assert noted(tmp_path / "h", "robomimic") == ["who.yaml"]
    assert noted(tmp_path / "h" / "demo.hdf5", "robomimic") == []


def test_many_are_counted(tmp_path):
    for k in range(9):
        (tmp_path / f"{k}.txt").touch()
    (note,) = of_folder(tmp_path, lambda name: False)
    assert "0.txt, 1.txt, 2.txt, 3.txt, 4.txt and 4 more." in note
