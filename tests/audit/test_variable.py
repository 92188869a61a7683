"""A variable is what it tells apart: names and orders change nothing."""

import numpy as np

from genpolicy.audit.variable import Variable, numbered


def test_groups_are_numbered_as_they_appear():
    assert numbered(np.array(["b", "a", "b", "c"])).tolist() == [0, 1, 0, 2]
    assert numbered(np.array([9, 7, 9, 1])).tolist() == [0, 1, 0, 2]


def test_draws_are_named_by_what_a_variable_says():
    one, other = Variable("a", np.array([0, 1, 0])), Variable("b", np.array([0, 1, 0]))
    assert one.key == other.key
    assert one.key != Variable("a", np.array([0, 1, 1])).key
    assert one.key != Variable("a", np.array([0.0, 1.0, 0.0])).key
    assert one.key != Variable("a", np.array([0, 1, 0]), by_row=True).key


def test_values_of_rows_and_another_order():
    episode = np.array([0, 0, 1])
    rows = np.array([2, 0])
    assert Variable("a", np.array([0, 1])).at(rows, episode[rows]).tolist() == [1, 0]
    by_row = Variable("a", np.array([5, 6, 7]), by_row=True)
    assert by_row.at(rows, episode[rows]).tolist() == [7, 5]
    turned = Variable("a", np.array([0, 1])).reordered(np.array([2, 0, 1]), np.array([1, 0]))
    assert turned.values.tolist() == [0, 1]
    measure = Variable("a", np.array([0.5, 2.5])).reordered(rows, np.array([1, 0]))
    assert measure.is_measure
    assert measure.values.tolist() == [2.5, 0.5]
