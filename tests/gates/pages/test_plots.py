"""Figures of the gates: drawn from whole evidence, named when it is not, never from half of it."""

import shutil

import pytest

from gates.evidence import Evidence
from gates.pages import plots_factors, plots_feasibility, plots_need, plots_stress, plots_time
from gates.pages.figures import draw_all
from gates.proof import judge

MODULES = {
    "A": (plots_need, plots_factors), "B": (plots_time,), "C": (plots_feasibility,),
    "D": (plots_stress,),
}  # fmt: skip
CASES = [(gate, module) for gate, modules in MODULES.items() for module in modules]
NAMES = [module.__name__.rpartition(".")[2] for _, module in CASES]


@pytest.fixture(scope="module")
def whole(tmp_path_factory, _ladder):
    root = tmp_path_factory.mktemp("plots") / "repo"
    shutil.copytree(_ladder, root)
    return root


@pytest.mark.parametrize(
    ("gate", "module"), CASES, ids=lambda value: getattr(value, "__name__", value)
)
def test_each_is_drawn_from_whole_evidence_and_the_same_twice(whole, gate, module):
    report = judge(whole, gate)
    first, again = (draw_all(module.PLOTS, Evidence(whole), report) for _ in range(2))
    assert [picture.skipped for picture in first] == [""] * len(module.PLOTS) != []
    assert first == again


@pytest.mark.parametrize(
    ("gate", "module"), CASES, ids=lambda value: getattr(value, "__name__", value)
)
def test_without_evidence_each_says_so(whole, tmp_path, gate, module):
    report = judge(whole, gate)
    pictures = draw_all(module.PLOTS, Evidence(tmp_path), report)
    assert len(pictures) == len(module.PLOTS)
    assert all("missing" in picture.skipped for picture in pictures)
