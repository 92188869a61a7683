"""Every figure with data of one, two, three and many components, with gaps, and with nothing."""

import re
import warnings

import pandas as pd
import pytest
from figure_frames import examples, neighbourhoods, strata, support

from genpolicy.pages.figures import checks, situations
from genpolicy.pages.figures.drawing import LEAST_TEXT_PX, drawn, new_figure
from genpolicy.pages.figures.situations import NothingToDrawError

WIDTHS = (1, 2, 3, 26)


XY = ["x", "y"]


def texts(svg):
    return re.findall(r">([^<>]+)</text>", str(svg))


def quiet(draw):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return drawn(draw, "a figure", salt="s")


def test_only_names_that_are_referred_to_are_kept_and_two_figures_share_none():
    frame = neighbourhoods(2)
    draw = lambda: situations.mean_versus_modes(frame, names=XY, unit="m")  # noqa: E731
    one, two = (str(drawn(draw, "a figure", salt=salt)) for salt in "ab")
    names = [set(re.findall(r' id="([^"]+)"', svg)) for svg in (one, two)]
    assert names[0] and not names[0] & names[1]
    for svg, own in ((one, names[0]), (two, names[1])):
        assert set(re.findall(r'(?:href="#|url\(#)([^")]+)', svg)) == own


@pytest.mark.parametrize("width", WIDTHS)
def test_every_width_is_drawn_without_a_warning_and_twice_the_same(width):
    names = [f"c{i}" for i in range(width)]
    for draw in (
        lambda: situations.clusters(examples(width), names=names, unit="m"),
        lambda: situations.mean_versus_modes(neighbourhoods(width), names=names, unit="m"),
        lambda: checks.support_map(support(width), names=names, unit="m", limit=0.2),
    ):
        svg = quiet(draw)
        assert svg == quiet(draw)
        assert "nan" not in str(svg).lower() and len(texts(svg)) > 8


@pytest.mark.parametrize(
    ("draw", "why"),
    [
        (lambda: situations.clusters(examples(2).iloc[:0], names=XY, unit=""), "comparable"),
        (lambda: situations.mean_versus_modes(neighbourhoods(2).iloc[:0], names=XY, unit=""),
         "several modes"),
        (lambda: checks.strata_bars(strata(n=0), level=0.05, limit=0.3), "no variable was tested"),
        (lambda: checks.support_map(support(2).iloc[:0], names=XY, unit="", limit=0.2),
         "no held-out situation"),
        (lambda: checks.label_agreement(pd.DataFrame({"mode": [], "label": [], "replayed": []})),
         "no episode was replayed"),
    ],
)  # fmt: skip
def test_nothing_to_draw_is_said(draw, why):
    with pytest.raises(NothingToDrawError, match=why):
        draw()


@pytest.mark.parametrize("size", [3.0, 7.0, 9.0, 20.0])
def test_a_plot_states_the_width_at_which_its_smallest_text_can_be_read(size):
    def draw():
        figure, (axes,) = new_figure()
        axes.text(0.5, 0.5, "small", fontsize=size)
        return figure

    svg = str(drawn(draw, "a figure", salt="s"))
    (least,) = map(int, re.findall(r'^<div class="plot" style="--least:(\d+)px"', svg))
    wide = float(re.search(r'viewBox="0 0 ([\d.]+)', svg).group(1))
    assert least - 1 < wide * LEAST_TEXT_PX / min(size, 9.0) <= least
    assert svg.count("<svg") == 1 and svg.endswith("</svg></div>")


def test_a_plot_without_text_may_be_as_narrow_as_it_is_drawn():
    def draw():
        figure, (axes,) = new_figure()
        axes.set_axis_off()
        return figure

    assert 'style="--least:533px"' in drawn(draw, "a figure", salt="s")
