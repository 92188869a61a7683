"""Both views: to one scale, side by side, up is up, and nothing of the workspace is cut."""

import numpy as np
import pytest

from genpolicy.replay.views import ABOVE, ASIDE, MARGIN_M, views_of
from genpolicy.tasks.api import Workspace

SPACE = Workspace(lower_m=(0.3, -0.2, 0.0), upper_m=(0.7, 0.2, 0.2))


def test_places_are_to_scale_and_up_is_up():
    """Golden by hand: 100 wide with a gap of 8 leaves 46 for 0.46 m."""
    above, aside = views_of(SPACE, width=100.0, gap=8.0)
    assert (above.side, aside.side, above.left, aside.left) == (ABOVE, ASIDE, 0.0, 54.0)
    assert above.scale == aside.scale == pytest.approx(100.0)
    assert above.height == pytest.approx(46.0) and aside.height == pytest.approx(26.0)
    np.testing.assert_allclose(above.places(np.array([[0.3, 0.2]])), [[3.0, 3.0]], atol=1e-9)
    np.testing.assert_allclose(aside.places(np.array([[0.3, 0.0]])), [[57.0, 23.0]], atol=1e-9)


def test_the_workspace_with_its_margin_fills_each_view():
    for view, axis in zip(views_of(SPACE, width=320.0, gap=8.0), (1, 2), strict=True):
        low, high = (np.array(end)[[0, axis]] for end in (SPACE.lower_m, SPACE.upper_m))
        corners = view.places(np.array([low - MARGIN_M, high + MARGIN_M]))
        expected = [[view.left, view.height], [view.left + 156.0, 0.0]]
        np.testing.assert_allclose(corners, expected, atol=1e-9)
