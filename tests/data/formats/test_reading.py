"""What of a table is read beside the contract: what is asked for, and what fits."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from genpolicy.data.formats import source
from genpolicy.data.formats.reading import reading
from genpolicy.data.formats.source import TOO_LARGE
from genpolicy.data.formats.tables import open_table, read_columns


@pytest.fixture
def table(layouts, tmp_path):
    wide = layouts.vectors(np.zeros((4, 50)))
    uneven = pa.array([[1.0], [2.0, 3.0], [4.0], [5.0]])
    pq.write_table(
        pa.table({"x": np.arange(4), "wide": wide, "uneven": uneven}), tmp_path / "t.parquet"
    )
    with open_table(tmp_path / "t.parquet", label="t") as table:
        yield table


def test_what_is_needed_is_read_once_and_the_rest_only_if_asked_for(table):
    assert reading(table, ["x", "x"], lambda column: False, rows=4).names == ["x"]
    read = reading(table, ["x"], lambda column: column.name == "wide", rows=4)
    assert (read.names, read.beside, read.left) == (["x", "wide"], {"wide"}, {})


def test_what_is_too_large_is_named_unless_it_is_needed(table, monkeypatch):
    # 50 numbers a row and one.
    monkeypatch.setattr(source, "MAXIMUM_BESIDE_BYTES", 1600 + 32)
    assert not reading(table, ["x"], lambda column: True, rows=4).left
    monkeypatch.setattr(source, "MAXIMUM_BESIDE_BYTES", 1600 + 31)
    read = reading(table, ["x"], lambda column: True, rows=4)
    assert read.left == {"wide": TOO_LARGE} and read.names == ["x", "uneven"]
    assert reading(table, ["wide"], lambda column: True, rows=4).names[:1] == ["wide"]


def test_rows_of_other_widths_are_missing_beside_and_refused_where_needed(table):
    assert np.isnan(read_columns(table, ["uneven"], {"uneven"})["uneven"]).all()
    with pytest.raises(source.ContractError, match="numbers wide"):
        read_columns(table, ["uneven"])
