"""The line that a criterion draws into a figure: its threshold, or none."""

from types import SimpleNamespace

from matplotlib.figure import Figure

from gates.pages.limits import draw_limit, limit_of

REPORT = SimpleNamespace(
    criteria=(
        SimpleNamespace(id="force_peak_p95_n", threshold=30.0),
        SimpleNamespace(id="stale", threshold=0.0), SimpleNamespace(id="open", threshold=None),
    )
)  # fmt: skip


def test_a_limit_is_that_of_the_named_criterion():
    assert limit_of(REPORT, "force_peak_p95_n") == 30.0
    assert limit_of(REPORT, "stale") == 0.0
    assert limit_of(REPORT, "open") is None and limit_of(REPORT, "absent") is None


def test_a_line_is_drawn_for_a_limit_also_of_zero_and_for_nothing_else():
    for name, count in (("stale", 1), ("open", 0), ("absent", 0)):
        axes = Figure().subplots()
        draw_limit(axes, REPORT, name, horizontal=True)
        assert len(axes.get_lines()) == count, name
