"""Figures of situations: clusters, overlays, scenes."""

import re
import warnings

import pytest
from figure_frames import examples, neighbourhoods

from genpolicy.audit.documents import Obstacle
from genpolicy.pages.figures import situations
from genpolicy.pages.figures.drawing import drawn


def texts(svg):
    return re.findall(r">([^<>]+)</text>", str(svg))


def quiet(draw):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return drawn(draw, "a figure", salt="s")


@pytest.mark.parametrize(("width", "drawn_there"), [(2, True), (26, False)])
def test_obstacles_stand_only_in_a_scene(width, drawn_there):
    names, stone = [f"c{i}" for i in range(width)], [Obstacle(x_m=0.0, y_m=0.0, radius_m=0.04)]
    for draw in (
        lambda: situations.clusters(examples(width), names=names, unit="m", obstacles=stone),
        lambda: situations.mean_versus_modes(
            neighbourhoods(width), names=names, unit="m", obstacles=stone
        ),
    ):
        assert (situations.STONE.lower() in str(quiet(draw)).lower()) == drawn_there


def test_situations_of_one_cluster_are_drawn_too():
    svg = quiet(lambda: situations.clusters(examples(2, clusters=1), names=["x", "y"], unit=""))
    assert "12 alike" in texts(svg)


@pytest.mark.parametrize(
    ("admissible", "said"),
    [(False, "mean, refused: 24 of 24"), (True, "mean, admissible: 24 of 24"),
     (None, "mean, not checked: 24 of 24")],
)  # fmt: skip
def test_the_overlay_says_what_the_check_said(admissible, said):
    frame = neighbourhoods(2, admissible=admissible)
    svg = quiet(lambda: situations.mean_versus_modes(frame, names=["x", "y"], unit="m"))
    assert said in texts(svg)
    assert any("are refused" in text for text in texts(svg)) == (admissible is False)
