"""Figures of Gate A: drawn by the level and the confidence that it was judged by."""

import evidence
import numpy as np
from otherwise import judged_by_others, without_confidence

from gates.evidence import Evidence
from gates.need.settings import MEASURED
from gates.pages import plots_scene
from gates.pages.plots_need import PLOTS

OWN = PLOTS[len(plots_scene.PLOTS) :]
MODES = f"{MEASURED.removeprefix('artifacts/')}/modes.parquet"
BASELINES = next(plot for plot in PLOTS if plot.title == "Modes that the simple policies keep")


def test_they_are_drawn_by_the_level_and_confidence_judged_by(copied):
    _, pictures = judged_by_others(copied, "A", OWN)
    drawn = "".join(picture.svg or "" for picture in pictures)
    assert (
        "adjusted p at most 0.013" in drawn
        and "90 % interval" in drawn
        and "95 % interval" not in drawn
    )


def test_without_the_confidence_judged_by_no_interval_is_drawn(whole, judged):
    assert without_confidence(whole, judged("A"), PLOTS) == ["'confidence'"] * 2


def test_only_what_is_deployed_and_draws_nothing_at_random_is_solid(copied, judged):
    def also_sampled(frame):
        return evidence.pd.concat([frame, frame.assign(convention="sampled")], ignore_index=True)

    evidence.edit_table(copied, MODES, also_sampled)
    settings = {**judged("A").settings, "generative_baselines": ["bc"]}
    report = judged("A").model_copy(update={"settings": settings})
    (axes,) = BASELINES.draw(Evidence(copied), report).axes
    names = [label.get_text() for label in axes.get_yticklabels()]
    solid = {n for n, bar in zip(names, axes.patches, strict=True) if not bar.get_hatch()}
    expected = {
        name for name in names
        if name.split(" · ")[1].split(" (")[0] in report.settings["deployed_conventions"]
        and name.split(" · ")[0] not in report.settings["generative_baselines"]
    }  # fmt: skip
    assert solid == expected and 0 < len(solid) < len(names)


def test_a_bar_has_the_interval_over_episodes_by_which_the_best_is_judged(copied, judged):
    report = judged("A")
    (axes,) = BASELINES.draw(Evidence(copied), report).axes
    (answer,) = [item for item in report.criteria if item.id == "baseline_mode_coverage"]
    ends = [tuple(line[:, 0]) for each in axes.collections for line in each.get_segments()]
    assert len(ends) == len(axes.patches)
    assert any(np.allclose(end, answer.interval) for end in ends)
    for bar, (lower, upper) in zip(axes.patches, ends, strict=True):
        assert lower <= bar.get_width() <= upper and upper - lower > 0.01


def test_a_bar_is_the_mean_share_over_situations_with_several_modes(copied, judged):
    def half(frame):
        return frame.assign(modes_present=2, modes_valid=[k % 2 for k in range(len(frame))])

    evidence.edit_table(copied, MODES, half)
    (axes,) = BASELINES.draw(Evidence(copied), judged("A")).axes
    assert {round(bar.get_width(), 9) for bar in axes.patches} == {0.25}
