"""Figures of Gate D: intervals by the confidence judged by, outcomes that add up."""

import evidence
import numpy as np
import pytest
from otherwise import judged_by_others, without_confidence

from gates.evidence import Evidence, MissingEvidenceError
from gates.pages.plots_stress import OUTCOMES, PLOTS

BY_TITLE = {plot.title: plot for plot in PLOTS}
TABLE = "stress/rollouts.parquet"


def test_the_interval_of_success_is_drawn_by_the_confidence_judged_by(copied):
    _, pictures = judged_by_others(copied, "D", PLOTS)
    assert any("exact 90 % interval" in picture.svg for picture in pictures)


def test_without_the_confidence_judged_by_no_interval_is_drawn(whole, judged):
    assert without_confidence(whole, judged("D"), PLOTS) == ["'confidence'"]


def _ends(root, judged):
    """Share of the rollouts of each method, by outcome."""
    (axes,) = BY_TITLE["How rollouts end"].draw(Evidence(root), judged("D")).axes
    return {c.get_label(): np.array([bar.get_width() for bar in c]) for c in axes.containers}


def test_outcomes_of_a_method_add_up_to_all_of_its_rollouts(copied, judged):
    """One that nobody knows is drawn behind the known ones, not left out."""
    names = ["exploded", *list(OUTCOMES)[:3]]

    def mixed(frame):
        return frame.assign(outcome=[names[k % 4] for k in range(len(frame))])

    evidence.edit_table(copied, TABLE, mixed)
    found = _ends(copied, judged)
    assert list(found) == [*list(OUTCOMES)[:3], "exploded"]
    assert sum(found.values()) == pytest.approx(1.0)


def test_rollouts_without_an_action_have_no_age(copied, judged):
    evidence.edit_table(copied, TABLE, lambda f: f.assign(action_ticks=0))
    with pytest.raises(MissingEvidenceError, match="no rollout executed an action"):
        BY_TITLE["Action age"].draw(Evidence(copied), judged("D"))
