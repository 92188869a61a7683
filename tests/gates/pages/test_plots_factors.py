"""What each part earns: one row per variant, one panel per measure, at its effect."""

import evidence
import numpy as np

from gates.evidence import Evidence
from gates.pages.figures import draw_all
from gates.pages.plots_factors import EFFECTS, PANELS, PLOTS
from genpolicy.evidence.rows.need import EffectRow

TABLE = EFFECTS.removeprefix("artifacts/")


def _effects(root, judged):
    """By panel: effects as drawn, from the top."""
    figure = PLOTS[0].draw(Evidence(root), judged("A"))
    assert len(figure.axes) == len(PANELS)
    return [
        [float(line.get_xdata()[0]) for line in axes.lines if line.get_marker() == "o"]
        for axes in figure.axes
    ]


def test_no_line_runs_through_a_number(whole, judged):
    for axes in PLOTS[0].draw(Evidence(whole), judged("A")).axes:
        assert axes.texts and all(text.get_bbox_patch() is not None for text in axes.texts)


def test_every_effect_is_drawn_once_in_the_panel_of_its_measure(whole, judged):
    frame = Evidence(whole).rows(EFFECTS, EffectRow)
    for drawn, (measures, _) in zip(_effects(whole, judged), PANELS, strict=True):
        expected = frame.loc[frame["measure"].isin(measures), "effect"]
        assert sorted(drawn) == sorted(expected) and len(drawn) > 0


def test_shares_are_percent_their_changes_points_and_what_they_are_means_of_is_said(whole, judged):
    figure = PLOTS[0].draw(Evidence(whole), judged("A"))
    error, *shares = figure.axes
    frame = Evidence(whole).rows(EFFECTS, EffectRow)
    (episodes,) = set(frame["episodes"])
    for axes in figure.axes:
        assert axes.get_xlabel().endswith(f"(n = {episodes} episodes)")
    for axes in shares:
        assert all(text.get_text().endswith(" %") for text in axes.texts) and axes.texts
        assert "points" in axes.get_xlabel() and axes.xaxis.get_major_formatter()(0.25) == "25"
    assert not any("%" in text.get_text() for text in error.texts)


def test_panels_of_other_episodes_say_from_how_many_to_how_many(copied, judged):
    def fewer(frame):
        return frame.assign(episodes=[1200 if n else 7 for n in range(len(frame))])

    evidence.edit_table(copied, TABLE, fewer)
    said = [a.get_xlabel() for a in PLOTS[0].draw(Evidence(copied), judged("A")).axes]
    assert any(text.endswith("(n = 7 to 1,200 episodes)") for text in said)


def test_the_order_of_the_rows_is_no_order_of_the_figure(copied, whole, judged):
    evidence.edit_table(copied, TABLE, lambda f: f.iloc[::-1])
    for one, other in zip(_effects(copied, judged), _effects(whole, judged), strict=True):
        assert sorted(one) == sorted(other)


def test_a_value_that_is_no_number_is_not_drawn(copied, judged):
    evidence.edit_table(copied, TABLE, lambda f: f.assign(value=np.nan))
    (picture,) = draw_all(PLOTS, Evidence(copied), judged("A"))
    assert picture.skipped == "column value has missing or non-finite values"
