"""Figures of the checks: support, strata, labels, clocks, success."""

import re
import warnings

import numpy as np
import pandas as pd
from figure_frames import strata, support

from genpolicy.pages.figures import checks
from genpolicy.pages.figures.drawing import drawn


def texts(svg):
    return re.findall(r">([^<>]+)</text>", str(svg))


def quiet(draw):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return drawn(draw, "a figure", salt="s")


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
