"""Figures with several methods: whatever has the colour of one is beside its name.

A name stands in a legend whose sample has that colour, or at the axis where a row, a column or a
panel is the method's own. And whatever is measured is in the unit that a person uses.
"""

from collections.abc import Iterator
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import Collection
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from gates.evidence import Evidence
from gates.pages.figures import METHODS, Plot, left_out, line_looks
from gates.pages.page import PLOTS
from gates.report import GateReport
from genpolicy.pages.figures.drawing import STYLE, svg

NAMES = {colour.lower(): name for name, colour in METHODS.items()}
CASES = [(gate, plot) for gate in "ABCD" for plot in PLOTS[gate] if isinstance(plot, Plot)]
SCENE = ("x,", "y,", "z,", "action chunk,")
"""Positions in a scene of a metre, and actions, which have the unit of their contract."""
MOST_OF_A_MARK = 2
"""Points of what stands for an interval or a limit, and is no line of a method."""
LEAST_SEVERAL = 8
"""Figures of the whole evidence in which several methods are told apart by colour."""


def _colours(artist: Artist) -> set[str]:
    if isinstance(artist, Line2D):
        return {to_hex(artist.get_color())}
    if isinstance(artist, Patch):
        return {to_hex(artist.get_facecolor()), to_hex(artist.get_edgecolor())}
    if isinstance(artist, Collection):
        return {to_hex(c) for c in (*artist.get_facecolor(), *artist.get_edgecolor())}
    return set()


def _methods(axes: Axes) -> set[str]:
    """Methods whose colour something in the axes has that is drawn and not only a sample."""
    drawn = (item for item in axes.get_children() if not isinstance(item, Legend))
    found = set()
    for item in drawn:
        empty = isinstance(item, Line2D) and np.size(item.get_xdata()) == 0
        if not empty:
            found |= {NAMES[c] for c in _colours(item) if c in NAMES}
    return found


def _legends(figure: Figure) -> list[Legend]:
    own = [axes.get_legend() for axes in figure.axes]
    return [*figure.legends, *(one for one in own if one is not None)]


def _in_legends(figure: Figure) -> Iterator[tuple[str, str]]:
    """Of each entry the method whose colour its sample has, and what stands beside it."""
    for legend in _legends(figure):
        for handle, text in zip(legend.legend_handles, legend.get_texts(), strict=True):
            for colour in _colours(handle) & set(NAMES):
                yield NAMES[colour], text.get_text()


def _at_the_axis(axes: Axes) -> list[str]:
    ticks = [*axes.get_yticklabels(), *axes.get_xticklabels()]
    return [tick.get_text() for tick in ticks] + [axes.get_xlabel(), axes.get_title()]


def _nameless(figure: Figure) -> set[str]:
    """Methods that something in a figure of several is coloured by, and nothing beside it names."""
    each = {axes: _methods(axes) for axes in figure.axes}
    if len(set().union(*each.values())) < 2:
        return set()
    said = {name for name, text in _in_legends(figure) if name in text}
    return {
        name
        for axes, names in each.items()
        for name in names - said
        if not any(text.partition(" ")[0].rstrip(":") == name for text in _at_the_axis(axes))
    }


def _drawn(root: Path, report: GateReport, plot: Plot) -> Figure:
    """The figure as the page has it: laid out, so that its texts stand where they are read."""
    if left_out(plot, report):
        pytest.skip("nothing was written to draw it from")
    with mpl.rc_context(STYLE):
        figure = plot.draw(Evidence(root), report)
        svg(figure, plot.title)
    return figure


@pytest.mark.parametrize(("gate", "plot"), CASES, ids=lambda value: getattr(value, "title", value))
def test_each_series_of_a_method_is_beside_its_name(whole, judged, gate, plot):
    assert _nameless(_drawn(whole, judged(gate), plot)) == set()


@pytest.mark.parametrize(("gate", "plot"), CASES, ids=lambda value: getattr(value, "title", value))
def test_an_axis_has_the_unit_that_a_person_uses(whole, judged, gate, plot):
    """Shares are percent; what is shorter than a metre or a second is in mm or ms."""
    for axes in _drawn(whole, judged(gate), plot).axes:
        for axis in (axes.xaxis, axes.yaxis):
            label, ticks = axis.get_label_text(), [t.get_text() for t in axis.get_ticklabels()]
            if label.startswith("share") or ": share" in label or label.endswith(", share"):
                assert ticks and all(tick.endswith(" %") for tick in ticks), label
            assert not label.endswith((", s", ", m")) or label.startswith(SCENE), label


def _alike(figure: Figure) -> set[tuple[str, str]]:
    """Methods of whom two lines in a panel, or two samples of a legend, differ by colour alone."""
    panels = [[one for one in axes.lines if one.get_linestyle() != "None"] for axes in figure.axes]
    samples = [h for one in _legends(figure) for h in one.legend_handles if isinstance(h, Line2D)]
    found = set()
    for lines in (*panels, samples):
        seen: dict[tuple[str, str], str] = {}
        for line in lines:
            name = NAMES.get(to_hex(line.get_color()))
            if name is not None and (np.size(line.get_xdata()) > MOST_OF_A_MARK or line in samples):
                look = (str(line.get_marker()), str(line._unscaled_dash_pattern))
                other = seen.setdefault(look, name)
                found |= {(other, name)} - {(name, name)}
    return found


@pytest.mark.parametrize(("gate", "plot"), CASES, ids=lambda value: getattr(value, "title", value))
def test_a_line_is_told_without_its_colour(whole, judged, gate, plot):
    """By its shape or its dash, where it is drawn and beside its name."""
    assert _alike(_drawn(whole, judged(gate), plot)) == set()


def test_lines_that_differ_by_colour_alone_are_seen():
    figure, place = Figure(), [0.0, 1.0, 2.0]
    axes = figure.subplots()
    (one, other), looks = [*METHODS][:2], line_looks([*METHODS])
    axes.plot(place, place, color=METHODS[one])
    axes.plot(place, place, color=METHODS[other])
    assert _alike(figure) == {(one, other)}
    told = {(look["marker"], str(look["ls"])) for look in looks.values()}
    assert len(told) == len(METHODS), "no two known methods look alike"


def test_several_methods_are_seen_in_most_figures(whole, judged):
    """Or the test above would find nothing, and say so of nothing."""
    several = 0
    for gate, plot in CASES:
        if not left_out(plot, judged(gate)):
            with mpl.rc_context(STYLE):
                figure = plot.draw(Evidence(whole), judged(gate))
            several += len(set().union(*map(_methods, figure.axes))) > 1
    assert several >= LEAST_SEVERAL
