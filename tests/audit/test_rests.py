"""Where the arm stands: the rows of a rest but the last, whatever the action says it in."""

from dataclasses import replace

import numpy as np
import pytest
from planar import planar

from genpolicy.audit.data import canonical
from genpolicy.audit.forms import Forms
from genpolicy.audit.rests import leaving, rank_of


def rested(rows):
    """The planar task; every episode is told to stand in its first `rows` rows."""
    data = canonical(planar(episodes=12)[0])
    first = data.first_row
    held = first + np.maximum(np.arange(len(first)) - first, rows)
    action = data.action[np.minimum(held, data.last_row)]
    return replace(data, action=action)


@pytest.mark.parametrize("rows", [3, 8])
def test_of_a_rest_only_the_last_row_leaves(rows):
    data = rested(rows)
    chosen = leaving(data)
    assert not chosen[data.index < rows - 1].any()
    assert chosen[data.index == rows - 1].all() and chosen[data.index == rows].all()
    assert rank_of(data, chosen)[data.index == rows - 1].max() == 0


def test_without_a_rest_every_row_counts_as_it_is_numbered():
    data = rested(0)
    assert np.mean(leaving(data)) > 0.9
    np.testing.assert_array_equal(rank_of(data, np.ones(len(data.index), dtype=bool)), data.index)


def test_changes_and_rates_stand_where_they_are_nothing():
    data = rested(0)
    width = data.action.shape[1]
    moved = np.where(data.index < 5, 0.0, 1.0)[:, None] * np.full(width, 0.01)
    forms = Forms(
        added=np.ones(width, dtype=bool), gain=np.full(width, 0.5), offset=np.zeros(width),
        partner=np.arange(width),
    )  # fmt: skip
    chosen = leaving(replace(data, action=moved, forms=forms))
    np.testing.assert_array_equal(chosen, data.index >= 4)


def test_where_nothing_moves_nothing_rests():
    data = canonical(planar(episodes=12)[0])
    assert leaving(replace(data, action=np.zeros_like(data.action))).all()
