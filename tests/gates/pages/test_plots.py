"""Figures of the gates: drawn from whole evidence, named when it is not, never from half of it."""

import pytest

from gates.evidence import Evidence
from gates.pages import (
    plots_convergence,
    plots_factors,
    plots_feasibility,
    plots_need,
    plots_scene,
    plots_stress,
    plots_time,
)
from gates.pages.figures import draw_all

MODULES = {
    "A": (plots_scene, plots_need, plots_factors), "B": (plots_convergence, plots_time),
    "C": (plots_feasibility,), "D": (plots_stress,),
}  # fmt: skip
CASES = [(gate, module) for gate, modules in MODULES.items() for module in modules]


@pytest.mark.parametrize(
    ("gate", "module"), CASES, ids=lambda value: getattr(value, "__name__", value)
)
def test_each_is_drawn_from_whole_evidence_and_the_same_twice(whole, judged, gate, module):
    first, again = (draw_all(module.PLOTS, Evidence(whole), judged(gate)) for _ in range(2))
    assert [picture.skipped for picture in first] == [""] * len(module.PLOTS) != []
    assert first == again


@pytest.mark.parametrize(
    ("gate", "module"), CASES, ids=lambda value: getattr(value, "__name__", value)
)
def test_without_evidence_each_says_so(judged, tmp_path, gate, module):
    pictures = draw_all(module.PLOTS, Evidence(tmp_path), judged(gate))
    assert len(pictures) == len(module.PLOTS)
    assert all("missing" in picture.skipped for picture in pictures)
