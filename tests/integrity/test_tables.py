"""Parquet: the same table gives the same bytes, a changed page is an error, a bomb is refused."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from genpolicy.errors import BadInputError, IntegrityError
from genpolicy.integrity import tables
from genpolicy.integrity.tables import read_table, write_table

ROWS = 400


def make():
    rng = np.random.default_rng(0)
    vectors = pa.FixedSizeListArray.from_arrays(pa.array(rng.normal(size=ROWS * 4)), 4)
    return pa.table({"x": rng.normal(size=ROWS), "v": vectors, "s": ["a", "b"] * (ROWS // 2)})


def test_round_trip_and_same_bytes(tmp_path):
    for name in ("a", "b"):
        write_table(tmp_path / name, make())
    assert read_table(tmp_path / "a").equals(make())
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_a_flip_never_becomes_another_number(tmp_path):
    """Pages are covered here; the footer is covered by the hash in the manifest."""
    path = tmp_path / "t"
    write_table(path, make())
    data = path.read_bytes()
    rng = np.random.default_rng(1)
    for position in rng.choice(8 * len(data), 200, replace=False):
        changed = bytearray(data)
        changed[position // 8] ^= 1 << (position % 8)
        path.write_bytes(bytes(changed))
        try:
            found = read_table(path)
        except BadInputError:
            continue
        if found.schema.names == make().schema.names and found.num_rows == ROWS:
            assert found["x"].equals(make()["x"])


@pytest.mark.parametrize("data", [b"", b"PAR1", b"x" * 100, b"PAR1" + b"\xff" * 50 + b"PAR1"])
def test_not_parquet(tmp_path, data):
    (tmp_path / "t").write_bytes(data)
    with pytest.raises(IntegrityError, match="not a readable table"):
        read_table(tmp_path / "t")
    with pytest.raises(IntegrityError, match="absent"):
        read_table(tmp_path / "absent")


def test_bomb(tmp_path, monkeypatch):
    pq.write_table(pa.table({"x": np.zeros(1_000_000)}), tmp_path / "t")
    assert (tmp_path / "t").stat().st_size < 100_000
    monkeypatch.setattr(tables, "MAXIMUM_TABLE_BYTES", 1_000_000)
    with pytest.raises(BadInputError, match="bytes in memory"):
        read_table(tmp_path / "t")
