"""The line of a limit: where the limit is, in view, and said."""

import pytest
from matplotlib.figure import Figure

from genpolicy.pages.figures.limits import limit_line


@pytest.fixture
def axes():
    made = Figure().subplots()
    made.set_xlim(0, 10)
    made.set_ylim(0, 1)
    return made


@pytest.mark.parametrize("horizontal", [True, False])
def test_a_line_stands_at_its_limit_and_is_named(axes, horizontal):
    limit_line(axes, 0.4, horizontal=horizontal, text="planned")
    (line,) = axes.get_lines()
    assert list(line.get_ydata() if horizontal else line.get_xdata()) == [0.4, 0.4]
    assert [text.get_text() for text in axes.texts] == ["planned 0.4"]


@pytest.mark.parametrize("limit", [-5.0, 25.0])
def test_the_view_grows_to_show_a_limit_and_shrinks_for_none(axes, limit):
    limit_line(axes, limit)
    low, high = axes.get_xlim()
    assert low < limit < high and low <= 0 and high >= 10
    assert axes.get_ylim() == (0, 1)
    limit_line(axes, 0.5, horizontal=True)
    assert axes.get_ylim() == (0, 1)


def test_the_name_stands_on_the_side_with_room(axes):
    limit_line(axes, 1.0)
    limit_line(axes, 9.0)
    assert [text.get_ha() for text in axes.texts] == ["left", "right"]
