"""The rows of the audit's tables: every column said in words, the types as they were."""

from dataclasses import fields

import pyarrow as pa
import pytest

from genpolicy.audit.rows import TABLES, ReplayRow, Resample, SituationRow
from genpolicy.integrity.rows import columns_of, schema_of

REAL, WHOLE = pa.float64(), pa.int64()


@pytest.mark.parametrize("row", TABLES.values())
def test_every_column_is_said_in_words(row):
    named = [name for name in columns_of(row) if f"        {name}: " in (row.__doc__ or "")]
    assert named == [item.name for item in fields(row)]


def test_every_table_has_a_row_of_its_own():
    assert len(set(TABLES.values())) == len(TABLES) == 17
    for name, row in TABLES.items():
        assert (row.__doc__ or "").startswith(f"`{name}.parquet`: ")


def test_types_of_the_tables_stay():
    lists = {field.name: field.type for field in schema_of(SituationRow)}
    assert lists["cluster_sizes"] == pa.list_(WHOLE) and lists["mean_path"] == pa.list_(REAL)
    assert lists["mode_paths"] == pa.list_(pa.list_(REAL))
    assert lists["mean_admissible"] == pa.bool_()
    drawn = {field.name: field.type for field in schema_of(Resample)}
    assert drawn["p_adjusted"] == pa.list_(REAL) and drawn["admissible"] == pa.list_(WHOLE)
    assert columns_of(ReplayRow) == ("episode_uuid", "label", "replayed", "mode")
