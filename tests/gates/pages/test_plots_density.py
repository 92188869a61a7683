"""Density beside mode coverage: shown on Gate B's page, judged nowhere."""

import evidence
import numpy as np
import pytest
from editing import cells
from otherwise import judged_by_others

from gates.evidence import Evidence
from gates.pages.figures import draw_all
from gates.pages.page import gate_page
from gates.pages.plots_density import PLOTS
from gates.proof import judge
from gates.reproducibility.densities import densities
from genpolicy.statistics.intervals import clopper_pearson

DENSITY = "reload/density.parquet"


def test_it_says_in_words_how_often_the_denser_mode_is_drawn_more_often(whole, judged):
    report = judged("B")
    (picture,) = draw_all(PLOTS, Evidence(whole), report)
    low, high = clopper_pearson(12, 16)
    said = f"75 % ({100 * low:.3g} to {100 * high:.3g})"
    assert picture.in_words[1:] == (
        ("diffusion", said, "16", "16", "0", "0"), ("flow", said, "16", "16", "0", "0"),
    )  # fmt: skip
    assert f"artifacts/{DENSITY}" in report.materials  # what is drawn is bound
    assert said in gate_page(whole, report)


def test_its_interval_is_that_of_the_confidence_judged_by(copied):
    _, (picture,) = judged_by_others(copied, "B", PLOTS)
    low, high = clopper_pearson(12, 16, 0.9)
    assert picture.in_words[1][1] == f"75 % ({100 * low:.3g} to {100 * high:.3g})"


def test_a_method_of_ties_alone_knows_nothing(copied, judged):
    evidence.edit_table(copied, DENSITY, cells("reached", 8))
    (picture,) = draw_all(PLOTS, Evidence(copied), judged("B"))
    assert picture.in_words[1] == ("diffusion", "not known", "0", "0", "16", "0")


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_a_density_that_is_no_finite_number_is_said_and_no_mean_is_drawn_over_it(
    copied, judged, value
):
    """One mode of situation 1 of flow; its other mode has no mean either."""

    def one(frame):
        return (frame["method"] == "flow") & (frame["index"] == 1) & (frame["mode"] == 0)

    evidence.edit_table(copied, DENSITY, cells("log_density", value, where=one))
    frame = densities(Evidence(copied))
    own = frame[frame["method"] == "flow"]
    assert set(own.loc[own["gain"].isna(), "index"]) == {1} and own["gain"].isna().sum() == 2
    (picture,) = draw_all(PLOTS, Evidence(copied), judged("B"))
    assert "infinite or no number" in picture.in_words[0][5]
    assert picture.in_words[1][2:] == ("16", "16", "0", "0")
    assert picture.in_words[2][2:] == ("15", "15", "0", "1")


def test_without_it_the_gate_judges_the_same_and_the_page_says_what_is_missing(ladder, judged):
    before = judged("B")
    evidence.edit_table(ladder, DENSITY, lambda frame: frame.head(0))
    report = judge(ladder, "B")
    assert (report.verdict, report.criteria) == (before.verdict, before.criteria)
    assert f"artifacts/{DENSITY} has no rows" in gate_page(ladder, report)
