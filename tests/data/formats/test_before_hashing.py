"""What cannot be read is refused before it is hashed: a hash of 300 GB takes minutes."""

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from genpolicy.data.formats import open_dataset, robomimic, tables, zarr_buffer
from genpolicy.errors import BadInputError

HUGE = 300 * 10**9


@pytest.fixture(autouse=True)
def no_hash(monkeypatch):
    def hashed(*_, **__):
        pytest.fail("hashed")

    monkeypatch.setattr(tables, "sha256", hashed)
    monkeypatch.setattr(robomimic, "sha256", hashed)
    monkeypatch.setattr(zarr_buffer, "sha256_tree", hashed)


def sparse(path, head, tail):
    with path.open("wb") as stream:
        stream.write(head)
        stream.truncate(HUGE)
        stream.seek(HUGE - len(tail))
        stream.write(tail)
    return path


def refused(path, tmp_path, match, **options):
    with pytest.raises(BadInputError, match=match):
        open_dataset(path, out=tmp_path / "out", **options)
    assert not (tmp_path / "out").exists()


def test_a_huge_file_without_a_table(tmp_path):
    footer = bytes(16) + (16).to_bytes(4, "little") + b"PAR1"
    path = sparse(tmp_path / "a.parquet", b"PAR1", footer)
    refused(path, tmp_path, "not a readable table")
    folder = tmp_path / "folder"
    folder.mkdir()
    path.rename(folder / path.name)
    refused(folder, tmp_path, "not a readable table")


def test_a_huge_file_that_is_no_hdf5(tmp_path):
    head = b"\x89HDF\r\n\x1a\n" + bytes(5) + b"\x08\x08" + bytes(25) + HUGE.to_bytes(8, "little")
    refused(sparse(tmp_path / "a.hdf5", head, b"x"), tmp_path, "not readable")


def test_a_table_that_claims_too_much_or_that_no_policy_could_use(tmp_path, monkeypatch):
    table = pa.table({"episode_index": np.arange(9), "x": np.arange(9.0)})
    pq.write_table(table, tmp_path / "a.parquet")
    refused(tmp_path / "a.parquet", tmp_path, "one that is an action")
    monkeypatch.setattr(tables, "MAXIMUM_SOURCE_ROWS", 8)
    refused(tmp_path / "a.parquet", tmp_path, "9 rows")


def test_an_hdf5_without_demonstrations(tmp_path):
    with h5py.File(tmp_path / "a.hdf5", "w") as file:
        file.create_group("data")
    refused(tmp_path / "a.hdf5", tmp_path, "empty")


def test_a_buffer_of_which_an_array_is_none(tmp_path):
    for name in ("meta/episode_ends", "data/state"):
        (tmp_path / "b" / name).mkdir(parents=True)
        (tmp_path / "b" / name / ".zarray").write_text("{}")
    refused(tmp_path / "b", tmp_path, "not an array description")
