"""What the audit's documents say of their own numbers."""

import dataclasses

import pytest

from genpolicy.audit.documents import Counts


@pytest.mark.parametrize(
    ("queries", "analysed", "share"), [(8, 2, 0.25), (4, 4, 1.0), (4, 0, 0.0), (0, 0, 0.0)]
)
def test_the_share_that_could_be_looked_at_is_none_where_nothing_was_asked(
    queries, analysed, share
):
    zero = dict.fromkeys((item.name for item in dataclasses.fields(Counts)), 0)
    assert Counts(**zero | {"queries": queries, "analysed": analysed}).share == share
