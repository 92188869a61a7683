"""Tables of others: what they claim is bounded before it is read."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from long_tables import rows

from genpolicy.data.formats import open_dataset
from genpolicy.data.formats import tables as tables_module
from genpolicy.errors import BadInputError


@pytest.fixture
def long(layouts, tmp_path):
    path = tmp_path / "long.parquet"
    pq.write_table(pa.concat_tables([rows(layouts, i) for i in range(8)]), path, row_group_size=70)
    return path


def test_damage_in_the_middle_refuses_what_lies_behind(long, tmp_path):
    whole = bytearray(long.read_bytes())
    metadata = pq.ParquetFile(long).metadata
    place = metadata.row_group(2).column(3).data_page_offset
    whole[place : place + 40] = bytes(40)
    long.write_bytes(whole)
    opened = open_dataset(long, out=tmp_path / "out")
    assert opened.found == 8
    assert opened.accepted == 4  # 140 rows stand before the damaged group
    assert all("not a readable table" in r.reason for r in opened.refused)


def broken(path, column, group=1):
    """The file with a damaged page of one column."""
    whole = bytearray(path.read_bytes())
    metadata = pq.ParquetFile(path).metadata
    names = [metadata.row_group(0).column(k).path_in_schema for k in range(metadata.num_columns)]
    part = metadata.row_group(group).column([n.split(".")[0] for n in names].index(column))
    place = part.dictionary_page_offset or part.data_page_offset
    whole[place : place + 40] = bytes(40)
    path.write_bytes(whole)


@pytest.mark.parametrize("column", ["emb", "list", "note", "lamp"])
@pytest.mark.parametrize("group", [0, 1])
def test_damage_in_what_nothing_depends_on_is_named(layouts, tmp_path, column, group):
    path = tmp_path / "long.parquet"
    more = {
        "emb": layouts.vectors(np.ones((240, 2))),
        "list": pa.array([[float(k // 30), 1.0] for k in range(240)]),
        "note": pa.array([f"n{k // 30}" for k in range(240)]),
        "lamp": pa.array([k // 30 % 2 for k in range(240)]),
    }
    table = pa.concat_tables([rows(layouts, i) for i in range(8)])
    for name, values in more.items():
        table = table.append_column(name, values)
    pq.write_table(table, path, row_group_size=70)
    contract = open_dataset(path, out=tmp_path / "first").contract
    chosen = contract.channels[:1]
    contract = contract.model_copy(update={"channels": chosen, "frozen": None, "pairing": None})
    broken(path, column, group)
    opened = open_dataset(path, out=tmp_path / "out", contract=contract)
    assert (opened.found, opened.accepted) == (8, 8)
    assert f"Not looked at as a reason, not readable: {column}." in opened.notes


def test_rows_read_before_the_damage_are_read_once(layouts, tmp_path, monkeypatch):
    monkeypatch.setattr(tables_module, "BATCH_ROWS", 40)
    path = tmp_path / "t.parquet"
    table = pa.table({"x": np.arange(200), "note": [f"{k} of many" for k in range(200)]})
    pq.write_table(table, path, use_dictionary=False, data_page_size=64, compression="none")
    whole = path.read_bytes()
    path.write_bytes(whole.replace(b"150 of many", b"\xff" * 11))
    left = {}
    with tables_module.open_table(path, label="t") as opened:
        found = tables_module.read_columns(opened, ["x", "note"], {"note"}, left)
    assert found["x"].tolist() == list(range(200)) and left == {"note": "not readable"}
    assert found["note"][0] in ("", "0 of many") and found["note"][199] == ""


def test_a_row_bomb_is_refused_by_what_it_claims(tmp_path, monkeypatch):
    """80 MB of numbers in 45 kB; the cap is lowered instead of the bomb made bigger."""
    count = 5_000_000
    path = tmp_path / "bomb.parquet"
    names = ("state", "action")
    table = pa.table({name: pa.array(np.zeros(count)).dictionary_encode() for name in names})
    pq.write_table(table, path, compression="zstd", row_group_size=count)
    assert path.stat().st_size < 100_000
    monkeypatch.setattr(tables_module, "MAXIMUM_SOURCE_ROWS", 1_000_000)
    with pytest.raises(BadInputError, match="is 5000000 rows, expected"):
        open_dataset(path, out=tmp_path / "out")
    monkeypatch.undo()
    with pytest.raises(BadInputError, match="5000000 rows long, expected at most 1000000"):
        open_dataset(path, out=tmp_path / "out")


def test_a_row_of_too_many_numbers_is_refused_by_what_it_claims(tmp_path):
    path = tmp_path / "wide.parquet"
    wide = pa.array([np.zeros(5000)])
    pq.write_table(pa.table({"state": wide, "action": wide}), path)
    with pytest.raises(BadInputError, match="5000 values in 1 rows"):
        open_dataset(path, out=tmp_path / "out")


def test_ragged_vectors_are_refused_by_row(tmp_path):
    folder = tmp_path / "ragged"
    folder.mkdir()
    rng = np.random.default_rng(0)
    for i in range(5):
        state = rng.normal(size=(20, 2)).tolist()
        if i == 2:
            state[7] = [1.0, 2.0, 3.0]
        table = pa.table({"state": state, "action": rng.normal(size=(20, 2)).tolist()})
        pq.write_table(table, folder / f"{i}.parquet")
    opened = open_dataset(folder, out=tmp_path / "out")
    assert [r.file for r in opened.refused] == ["2.parquet"]
    assert "state, row 7 is 3 numbers wide" in opened.refused[0].reason
    assert opened.contract.pairing is None
