"""Min-max to [-1, 1]: there and back, constants in the middle, statistics that are whole."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from genpolicy.contract.normalisation import SMALLEST_RANGE, MinMax, Normalisation, statistics_of
from genpolicy.errors import ContractError, NonFiniteError

rows = st.lists(
    st.lists(st.floats(-100, 100), min_size=3, max_size=3), min_size=2, max_size=20
).map(np.array)


@given(rows)
def test_there_and_back_and_inside_one(values):
    statistics = statistics_of(values)
    normalised = statistics.normalise(values)
    assert (np.abs(normalised) <= 1 + 1e-9).all()
    back = statistics.denormalise(normalised)
    np.testing.assert_allclose(back, values, atol=SMALLEST_RANGE)


def test_the_ends_and_the_middle():
    """By hand: of 2 to 6, 4 is the middle, and 8 lies as far outside as the range is wide."""
    statistics = MinMax(minimum=[2.0], maximum=[6.0])
    values = np.array([[2.0], [4.0], [6.0], [8.0]])
    np.testing.assert_array_equal(statistics.normalise(values).ravel(), [-1, 0, 1, 2])


def test_a_constant_is_zero_and_comes_back_as_itself():
    statistics = MinMax(minimum=[3.0, 0.0], maximum=[3.0, 1.0])
    np.testing.assert_array_equal(statistics.normalise(np.array([9.0, 1.0])), [0.0, 1.0])
    np.testing.assert_array_equal(statistics.denormalise(np.array([5.0, 0.0])), [3.0, 0.5])


def test_statistics_do_not_change_with_their_source():
    low = np.zeros(2)
    statistics = MinMax(minimum=low, maximum=np.ones(2))
    low[:] = 9
    assert not statistics.minimum.any() and statistics.dim == 2
    with pytest.raises(ValueError, match="read-only"):
        statistics.maximum[0] = 4


def test_json_there_and_back():
    both = Normalisation(MinMax([0.1, -2.0], [0.3, 5.0]), MinMax([1e-9], [1 / 3]))
    again = Normalisation.from_json(json.loads(json.dumps(both.as_json())))
    assert again.as_json() == both.as_json()
    assert again.action.maximum.tobytes() == both.action.maximum.tobytes()


@pytest.mark.parametrize(
    ("low", "high", "error", "text"),
    [
        ([1.0], [0.0], NonFiniteError, "minimum above its maximum"),
        ([np.nan], [0.0], NonFiniteError, "not finite"),
        ([0.0], [np.inf], NonFiniteError, "not finite"),
        ([0.0], [1.0, 2.0], ContractError, r"of shapes \(1,\) and \(2,\)"),
        ([], [], ContractError, "two vectors of one length"),
        ([[0.0]], [[1.0]], ContractError, "two vectors of one length"),
    ],
)
def test_statistics_that_are_none_are_refused(low, high, error, text):
    with pytest.raises(error, match=text):
        MinMax(minimum=low, maximum=high)


@pytest.mark.parametrize(
    "values",
    [{}, {"observation": {"minimum": [0], "maximum": [1]}}, {"observation": 1, "action": 2},
     {"observation": {"minimum": ["a"], "maximum": [1]}, "action": {}}],
)  # fmt: skip
def test_a_document_that_is_no_statistics_is_refused(values):
    with pytest.raises(ContractError, match="normalisation statistics is not readable"):
        Normalisation.from_json(values)


def test_no_rows_have_no_statistics():
    with pytest.raises(NonFiniteError, match="of no rows"):
        statistics_of(np.empty((0, 3)))
