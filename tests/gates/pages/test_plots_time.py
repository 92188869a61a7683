"""Figures of Gate B about time: the warm calls alone, and which terms are declared."""

import evidence
import numpy as np
import pytest

from gates.evidence import Evidence
from gates.pages.figures import draw_all
from gates.pages.plots_time import MILLI, PLOTS
from gates.reproducibility.timing import LATENCY, MEASURED_HERE, TERMS

TABLE = LATENCY.removeprefix("artifacts/")
BY_TITLE = {plot.title: plot for plot in PLOTS}


def test_terms_that_nobody_measured_are_named_as_declared(whole, judged):
    (axes,) = BY_TITLE["Where the time goes"].draw(Evidence(whole), judged("B")).axes
    names = [label.get_text() for label in axes.get_yticklabels()]
    assert names == [t if t in MEASURED_HERE else f"{t} (declared)" for t in TERMS]


def test_cold_calls_are_in_no_figure(copied, whole, judged):
    def slow(frame):
        return frame.assign(seconds=frame["seconds"] * (1 + 99 * (frame["temperature"] == "cold")))

    evidence.edit_table(copied, TABLE, slow)
    assert draw_all(PLOTS, Evidence(copied), judged("B")) == draw_all(
        PLOTS, Evidence(whole), judged("B")
    )
    evidence.edit_table(copied, TABLE, lambda f: f[f["temperature"] == "cold"])
    assert draw_all(PLOTS, Evidence(copied), judged("B"))[0].skipped == "no warm measurement"


def test_a_second_process_has_a_curve_of_its_own_in_milliseconds(copied, judged):
    seconds = {1: 0.002, 2: 0.004}
    evidence.edit_table(copied, TABLE, lambda f: f.assign(seconds=f["run"].map(seconds)))
    (axes,) = (
        BY_TITLE["Two fresh processes, same latency?"].draw(Evidence(copied), judged("B")).axes
    )
    drawn = {line.get_label(): line.get_xdata() for line in axes.lines}
    for run, each in seconds.items():
        assert np.asarray(drawn[f"flow, run {run}"]) == pytest.approx(MILLI * each)
