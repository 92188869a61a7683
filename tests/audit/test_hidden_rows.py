"""The rows of what may hide are tables of the audit like all others."""

import pytest

from genpolicy.audit import hidden_rows, rows


@pytest.mark.parametrize(
    ("table", "name"), [("strata", "Stratum"), ("predictions", "Prediction"), ("asked", "Asked")]
)
def test_each_is_read_from_where_all_tables_stand(table, name):
    assert rows.TABLES[table] is getattr(hidden_rows, name) is getattr(rows, name)
