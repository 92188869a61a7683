"""The line of a limit: where the limit is, in view, and said."""

import pytest
from matplotlib.figure import Figure

from genpolicy.pages.figures.drawing import in_milli, in_percent, plain_ticks
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


@pytest.mark.parametrize(
    ("unit", "limit", "said"),
    [
        (in_percent, 0.07, "7 %"), (in_percent, 0.125, "12.5 %"), (in_milli, 0.02, "20"),
        (in_milli, -0.0005, "-0.5"), (plain_ticks, 0.07, "0.07"),
    ],
)  # fmt: skip
@pytest.mark.parametrize("horizontal", [True, False])
def test_a_limit_is_said_in_the_unit_of_its_axis(axes, unit, limit, said, horizontal):
    """And so are the ticks; the line stays where it is in SI units."""
    axis = axes.yaxis if horizontal else axes.xaxis
    unit(axis)
    limit_line(axes, limit, horizontal=horizontal)
    assert [text.get_text() for text in axes.texts] == [f"limit {said}"]
    assert axis.get_major_formatter()(limit) == said
    (line,) = axes.get_lines()
    assert set(line.get_ydata() if horizontal else line.get_xdata()) == {limit}


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
