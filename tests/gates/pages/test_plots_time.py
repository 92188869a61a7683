"""Figures of Gate B about time: the warm calls alone, and which terms are declared."""

import evidence
import numpy as np
import pytest

from gates.evidence import Evidence
from gates.pages.figures import draw_all
from gates.pages.plots_time import MILLI, PLOTS
from gates.reproducibility.timing import LATENCY, MEASURED_HERE, TERMS

TABLE = LATENCY.removeprefix("artifacts/")
TWICE = "Measured twice, the same latency?"
BY_TITLE = {plot.title: plot for plot in PLOTS}


def test_terms_that_nobody_measured_are_named_as_declared(whole, judged):
    (axes,) = BY_TITLE["Where the time goes"].draw(Evidence(whole), judged("B")).axes
    names = [label.get_text() for label in axes.get_yticklabels()]
    assert names == [t if t in MEASURED_HERE else f"{t} (declared)" for t in TERMS]


def test_cold_calls_are_in_no_figure_but_the_one_that_names_them(copied, whole, judged):
    def slow(frame):
        return frame.assign(seconds=frame["seconds"] * (1 + 99 * (frame["temperature"] == "cold")))

    def drawn(root):
        found = draw_all(PLOTS, Evidence(root), judged("B"))
        return {shown.title: shown.svg for shown in found}

    before = drawn(whole)
    evidence.edit_table(copied, TABLE, slow)
    after = drawn(copied)
    assert {title for title in before if before[title] != after[title]} == {TWICE}
    evidence.edit_table(copied, TABLE, lambda f: f[f["temperature"] == "cold"])
    assert draw_all(PLOTS, Evidence(copied), judged("B"))[0].skipped == "no warm measurement"


def test_each_process_has_a_mark_of_its_own_in_milliseconds(copied, judged):
    """Full in the first measurement, hollow in the second; five terms of an invocation summed."""
    seconds = {1: 0.002, 2: 0.004}
    evidence.edit_table(copied, TABLE, lambda f: f.assign(seconds=f["run"].map(seconds)))
    warm, cold = BY_TITLE[TWICE].draw(Evidence(copied), judged("B")).axes
    for axes in (warm, cold):
        for line in axes.lines:
            run = 2 if line.get_markerfacecolor() == "white" else 1
            assert np.asarray(line.get_xdata()) == pytest.approx([5 * MILLI * seconds[run]] * 3)


def test_the_budget_stands_in_words_below_the_figure(whole, judged):
    report = judged("B")
    heads, *rows = BY_TITLE["Where the time goes"].read(Evidence(whole), report)
    assert heads[:4] == ("method", "term", "owner", "known from") and len(heads) == 10
    own = [row for row in rows if row[0] == "flow"]
    assert [row[1] for row in own] == ["end to end", "p95 of the terms, summed", *TERMS]
    assert {row[1] for row in own if row[3] == "declared"} == set(TERMS) - set(MEASURED_HERE)
    # Eight values of 48 invocations each, two runs of three processes: no upper end of a p95.
    assert "to" in own[0][4] and float(own[1][5]) > 0


def test_more_candidates_and_a_load_stand_beside_the_deadline(whole, copied, judged):
    plot = BY_TITLE["What do more candidates cost, and what a busy machine?"]
    (axes,) = plot.draw(Evidence(whole), judged("B")).axes
    assert [label.get_text() for label in axes.get_xticklabels()] == ["1", "4", "8", "32"]
    faces = [line.get_markerfacecolor() for line in axes.lines if len(line.get_xdata()) == 1]
    assert faces.count("white") == len(faces) // 2 == 4 * len(evidence.CANDIDATES)
    assert "deadline of the whole answer" in [text.get_text() for text in axes.texts]
    evidence.replace(copied, "reload/identity.json", None)
    (axes,) = plot.draw(Evidence(copied), judged("B")).axes
    assert not list(axes.texts)
