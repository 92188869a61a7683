"""What importers hand over: columns of the declared width and of one length, or a refusal."""

import numpy as np
import pytest

from genpolicy.data.formats.source import Column, as_float, check_columns, refusal_of, refuse
from genpolicy.errors import ContractError

KNOWN = {
    "state": Column("state", 3), "time": Column("time", None), "note": Column("note", None, "text"),
}  # fmt: skip


def check(**columns):
    check_columns(columns, label="demo_1", known=KNOWN)


def test_columns_in_order_pass_flags_and_texts_included():
    check(state=np.zeros((4, 3), bool), time=np.arange(4), note=np.array(["a"] * 4))


@pytest.mark.parametrize(
    ("columns", "said"),
    [
        ({"state": np.zeros((4, 2))}, r"demo_1: state.*\(4, 3\)"),
        ({"state": np.zeros(4)}, r"state.*\(4,\)"),
        ({"time": np.zeros((4, 1))}, r"time.*\(4, 1\)"),
        ({"state": np.full((4, 3), "x")}, "state.*numbers"),
        ({"time": np.zeros(4, complex)}, "time.*complex.*numbers"),
        ({"time": np.zeros(4), "state": np.zeros((5, 3))}, "state.*5 rows long.*4, as the others"),
    ],
)
def test_each_deviation_names_episode_and_column(columns, said):
    with pytest.raises(ContractError, match=said):
        check(**columns)


def test_numbers_become_doubles_without_a_change_of_value():
    values = as_float(np.array([1, 2**53], dtype=np.int64))
    assert values.dtype == np.float64 and values.tolist() == [1.0, 2.0**53]


def test_an_error_becomes_the_refusal_of_its_episode():
    with pytest.raises(ContractError) as caught:
        refuse("row 7", "NaN", "numbers")
    refusal = refusal_of("demo_1", caught.value)
    assert (refusal.file, refusal.where) == ("demo_1", "row 7")
    assert "NaN" in refusal.reason and "leave this episode out" in refusal.reason
