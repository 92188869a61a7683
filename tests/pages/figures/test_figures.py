"""Every figure with data of one, two, three and many components, with gaps, and with nothing."""

import re
import warnings

import numpy as np
import pandas as pd
import pytest

from genpolicy.pages.figures import checks, situations
from genpolicy.pages.figures.drawing import drawn
from genpolicy.pages.figures.situations import NothingToDrawError

WIDTHS = (1, 2, 3, 26)
XY = ["x", "y"]


def examples(width, clusters=2, members=12, steps=10):
    rng = np.random.default_rng(width)
    rows = []
    for number in range(2):
        for k in range(members):
            side = k % clusters
            path = np.cumsum(rng.normal(0, 0.01, (steps, width)), axis=0)
            path[:, 0] += 0.1 * side * np.arange(steps)
            rows.append(
                {
                    "example": number, "phase": "reach", "query_uuid": f"episode-{number}",
                    "query_index": 4, "is_query": k == 0, "distance": 0.3 * k, "cluster": side,
                    "coordinate": 0.1 * side, "path": path.ravel(),
                }
            )  # fmt: skip
    return pd.DataFrame(rows)


def neighbourhoods(width, admissible=False, rows=30, steps=10):
    rng = np.random.default_rng(width)
    walk = np.cumsum(rng.normal(0, 0.01, (rows, 3, steps, width)), axis=2)
    return pd.DataFrame(
        {
            "two_mode": [True] * rows,
            "mean_admissible": [admissible] * rows,
            "mean_reason": ["geometric: scene_collision" if admissible is False else ""] * rows,
            "mean_path": [path.ravel() for path in walk[:, 2]],
            "mode_paths": [[one.ravel(), two.ravel()] for one, two, _ in walk],
        }
    )


def support(width, rows=40):
    return pd.DataFrame(
        {
            "phase": ["reach"] * rows, "index": range(rows),
            "analysed": [i % 3 > 0 for i in range(rows)],
            "two_mode": [i % 6 == 1 for i in range(rows)],
            "position": list(np.random.default_rng(1).normal(size=(rows, width))),
        }
    )  # fmt: skip


def strata(**changed):
    row = {
        "variable": "operator", "phase": "reach", "p_adjusted": 0.01, "effect": 0.6,
        "effect_lower": 0.4, "effect_upper": 0.8, "n": 80,
    }  # fmt: skip
    return pd.DataFrame([row | changed])


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


@pytest.mark.parametrize(("width", "drawn_there"), [(2, True), (26, False)])
def test_obstacles_stand_only_in_a_scene(width, drawn_there):
    names, stone = [f"c{i}" for i in range(width)], [{"x_m": 0.0, "y_m": 0.0, "radius_m": 0.04}]
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


def test_support_is_counted_on_all_rows_not_on_those_drawn():
    svg = quiet(lambda: checks.support_map(support(2, 5000), names=["x", "y"], unit="m", limit=0.2))
    missing = sum(i % 3 == 0 for i in range(5000))
    assert f"too few neighbours ({missing})" in texts(svg)


def test_a_variable_that_could_not_be_tested_is_named_not_drawn():
    frame = pd.concat([strata(), strata(variable="object", effect=np.nan, n=0),
                       strata(variable="history", effect=0.0, n=0)])  # fmt: skip
    svg = quiet(lambda: checks.strata_bars(frame, level=0.05, limit=0.3))
    assert "could not be tested: history, object" in texts(svg)
    assert "operator · reach" in texts(svg) and "object · reach" not in texts(svg)


def test_labels_are_counted_by_mode():
    frame = pd.DataFrame(
        {
            "mode": ["m0", "m0", "m1", None], "label": ["success", "success", "failure", "failure"],
            "replayed": ["success", "failure", "success", "failure"],
        }
    )  # fmt: skip
    found = texts(quiet(lambda: checks.label_agreement(frame)))
    assert {"m0", "m1", "in no mode", "label agrees (2)"} <= set(found)
    assert "labelled success, replay fails (1)" in found
    assert "labelled failure, replay succeeds (1)" in found


def test_a_clock_that_is_unknown_is_left_out():
    frame = pd.DataFrame(
        {
            "episode_uuid": ["a", "b", "c"], "epoch": ["e0", "e0", "e1"], "order": [0.0, 1.0, 2.0],
            "offset_before_s": [0.1, np.nan, -0.1], "offset_after_s": [0.0, np.nan, 0.0],
        }
    )  # fmt: skip
    draw = lambda: checks.realignment(frame, limit_s=0.02, modes_before=9, modes_after=1)  # noqa: E731
    found = texts(quiet(draw))
    assert "as recorded: 9 episodes with several modes" in found
    assert "realigned: 1 episodes with several modes" in found


def test_success_without_an_episode_is_an_interval_without_a_point():
    frame = pd.DataFrame(
        {
            "mode": ["m0"], "phase": ["reach"], "episodes": [0], "successes": [0],
            "success_lower": [0.0], "success_upper": [1.0],
        }
    )  # fmt: skip
    svg = quiet(lambda: checks.mode_success(frame, confidence=0.95, limit=0.5))
    assert "m0 · reach (n = 0)" in texts(svg)


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
