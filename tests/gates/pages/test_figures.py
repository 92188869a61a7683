"""Figures: every method keeps its colour and its shape, and nobody takes one for another."""

from itertools import combinations

import numpy as np
import pytest
from colorspacious import cspace_convert

from gates.pages.figures import METHODS, colours, dashes, in_order, markers
from genpolicy.policies import methods

APART = 15.0
"""Least distance of two colours, in units of CAM02-UCS."""
GREY = 20.0
"""Least distance of a colour from the grey of its lightness, CIELab."""
EYES = {
    "usual": None,
    "without red": "protanomaly",
    "without green": "deuteranomaly",
    "without blue": "tritanomaly",
}


def _rgb(colours: list[str]) -> np.ndarray:
    return np.array([[int(c[i : i + 2], 16) / 255 for i in (1, 3, 5)] for c in colours])


def _closest(colours: list[str], eyes: str | None) -> tuple[float, tuple[str, str]]:
    """Least distance of any two, as those eyes see them, and which (Machado and others 2009)."""
    rgb = _rgb(colours)
    if eyes is not None:
        seen = {"name": "sRGB1+CVD", "cvd_type": eyes, "severity": 100}
        rgb = np.clip(cspace_convert(rgb, seen, "sRGB1"), 0, 1)
    places = cspace_convert(rgb, "sRGB1", "CAM02-UCS")
    pairs = combinations(range(len(colours)), 2)
    least, one, other = min((float(np.linalg.norm(places[a] - places[b])), a, b) for a, b in pairs)
    return least, (colours[one], colours[other])


def test_a_method_keeps_its_colour_in_every_figure():
    assert in_order(["flow", "zeta", "act", "bc", "act"]) == ["bc", "act", "flow", "zeta"]
    few, many = colours(["flow", "act"]), colours([*METHODS, "zeta", "eta"])
    assert all(many[name] == METHODS[name] for name in METHODS)
    assert few == {name: METHODS[name] for name in ("act", "flow")}
    assert len({str(look) for look in dashes(["act", "flow", "cvae"]).values()}) == 3


def test_every_method_of_ours_has_a_colour_and_a_shape_of_its_own():
    assert set(METHODS) == set(methods.METHODS)
    assert len(set(markers(METHODS).values())) == len(METHODS)


def test_who_was_brought_takes_what_is_free():
    brought = ["flow", "diffusion", "mine", "yours"]
    assert len(set(colours(brought).values())) == len(set(markers(brought).values())) == 4
    assert set(colours(["mine"]).values()) <= set(METHODS.values())


@pytest.mark.parametrize("eyes", EYES.values(), ids=EYES)
def test_any_two_methods_are_told_apart_by_any_eyes(eyes):
    least, pair = _closest(list(METHODS.values()), eyes)
    assert least >= APART, f"{pair} are {least:.1f} apart"


def test_the_measure_sees_red_and_green_fall_together():
    """Of the same two colours the usual eyes see two, those without green one."""
    pair = ["#B05050", "#708030"]
    assert _closest(pair, None)[0] > APART > _closest(pair, "deuteranomaly")[0]


def test_no_method_is_grey():
    lab = cspace_convert(_rgb(list(METHODS.values())), "sRGB1", "CIELab")
    assert np.hypot(lab[:, 1], lab[:, 2]).min() >= GREY
