"""Settings of the sweep on Gate B's page: figure, table and sentences, bound to the report."""

import evidence

from gates.evidence import Evidence
from gates.pages.figures import draw_all
from gates.pages.page import gate_page
from gates.pages.plots_front import PLOTS
from gates.proof import judge
from gates.reproducibility.front import SWEEP


def test_every_setting_stands_in_the_table_and_the_deadline_in_the_figure(whole, judged):
    report = judged("B")
    figure, listing = draw_all(PLOTS, Evidence(whole), report)
    heads, *rows = figure.in_words
    assert len(heads) == 10 and [row[2] for row in rows if row[0] == "flow"] == [*"248", "16"]
    assert {row[0] for row in listing.listed[1:]} == {row[0] for row in rows}
    # More coverage for more time: all of them are on the front.
    assert {row[-1] for row in rows} == {"yes"}
    (axes, _, _) = PLOTS[0].draw(Evidence(whole), report).axes
    assert [line for line in axes.lines if len(set(line.get_xdata())) == 1 and
            list(line.get_ydata()) == [0, 1]]  # fmt: skip
    assert SWEEP in report.materials, "what is drawn is bound"
    assert listing.listed[1][1] in gate_page(whole, report)


def test_without_times_the_gate_judges_the_same_and_the_page_says_what_is_missing(ladder, judged):
    before = judged("B")
    evidence.edit_table(ladder, SWEEP.removeprefix("artifacts/"), lambda frame: frame.head(0))
    report = judge(ladder, "B")
    assert (report.verdict, report.criteria) == (before.verdict, before.criteria)
    assert f"{SWEEP} has no rows" in gate_page(ladder, report)


def test_one_of_whom_a_term_is_unknown_stands_on_no_axis_and_hides_nobody(ladder):
    """Wrong before: with a brought candidate, which nobody timed, the figure was empty."""
    path = SWEEP.removeprefix("artifacts/")
    evidence.edit_table(ladder, path, lambda frame: frame[frame["method"] != "flow"])
    figure, _ = draw_all(PLOTS, Evidence(ladder), judge(ladder, "B"))
    assert {row[0] for row in figure.in_words[1:]} == {"diffusion"}


def test_a_setting_that_diverges_is_marked_in_the_table(ladder):
    def diverged(frame):
        one = (frame["method"] == "flow") & (frame["steps"] == 2)
        lost = frame[["chunk_error", "jerk_p95_m_s3"]].mask(one)
        return frame.assign(nonfinite=frame["nonfinite"].mask(one, 7), **lost)

    evidence.edit_table(ladder, "reload/coverage.parquet", diverged)
    figure, _ = draw_all(PLOTS, Evidence(ladder), judge(ladder, "B"))
    said = {row[2]: row[-1] for row in figure.in_words[1:] if row[0] == "flow"}
    assert said == {"2": "no: 7 chunks are no numbers", "4": "yes", "8": "yes", "16": "yes"}
