"""Values of a Parquet column: nulls, several numbers a row, and rows in which nothing is."""

import numpy as np
import pyarrow as pa
import pytest

from genpolicy.data.formats.source import Column
from genpolicy.data.formats.values import array_of, is_even, missing
from genpolicy.errors import ContractError


def test_numbers_texts_and_nulls():
    assert array_of(pa.array([1, None]), Column("x", None), "t", 0)[0] == 1
    assert np.isnan(array_of(pa.array([1, None]), Column("x", None), "t", 0)[1])
    texts = array_of(pa.array(["a", None]), Column("x", None, "text"), "t", 0)
    assert texts.tolist() == ["a", ""]


def test_rows_of_one_width_and_of_others():
    even, uneven = pa.array([[1.0, 2.0], [3.0, 4.0]]), pa.array([[1.0, 2.0], [3.0]])
    column = Column("x", 2)
    assert array_of(even, column, "t", 0).shape == (2, 2)
    assert (is_even(even, column), is_even(uneven, column)) == (True, False)
    with pytest.raises(ContractError, match="row 8 is 1 numbers wide"):
        array_of(uneven, column, "t", 7)


def test_what_is_missing_has_the_shape_of_what_is_there():
    assert missing(2, Column("x", 3)).shape == (2, 3) and np.isnan(missing(2, Column("x", 3))).all()
    assert missing(2, Column("x", None)).shape == (2,)
    assert missing(2, Column("x", None, "text")).tolist() == ["", ""]
