"""Figures of the gates: drawn from whole evidence, named when it is not, never from half of it."""

import shutil

import evidence
import pytest

from gates.evidence import Evidence
from gates.pages import (
    plots_convergence,
    plots_factors,
    plots_feasibility,
    plots_need,
    plots_stress,
    plots_time,
)
from gates.pages.figures import draw_all
from gates.pages.page import gate_page
from gates.proof import judge

MODULES = {
    "A": (plots_need, plots_factors), "B": (plots_convergence, plots_time),
    "C": (plots_feasibility,), "D": (plots_stress,),
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


def test_the_figure_of_convergence_says_in_words_what_it_draws(whole):
    report = judge(whole, "B")
    (picture,) = draw_all(plots_convergence.PLOTS, Evidence(whole), report)
    heads, *rows = picture.in_words
    by_method = {row[0]: dict(zip(heads, row, strict=True)) for row in rows}
    limit = next(c.threshold for c in report.criteria if c.id == "baseline_fall_upper")
    assert (
        f"limit {limit:g}" in picture.svg and f"{limit:g}" == by_method["chunked_bc"]["its limit"]
    )
    assert by_method["flow"]["its limit"] == "asked by samples"
    stated = next(c for c in report.criteria if c.id == "baseline_fall_upper")
    low, high = stated.interval
    fall = by_method["chunked_bc"]["fall over the last quarter"]
    assert fall.endswith(f"({low:.3g} to {high:.3g})") and fall.startswith("0.04 ")
    for row in by_method.values():
        assert row["from"] in report.materials  # what is drawn is bound
    page = gate_page(whole, report)
    assert page.count("The same as a table") == 1 and f'<td class="n">{fall}</td>' in page


def _judged_by_others(whole, root, gate):
    """The report and the pictures of a gate under another level and another confidence."""
    shutil.copytree(whole, root)

    def change(params):
        params["confidence"] = 0.9
        (owner,) = [part for part in params["gate_a"]["cause"].values() if "strata_p" in part]
        owner["strata_p"][0] = 0.013

    evidence.write_params(root, change)
    report = judge(root, gate)
    return report, [draw_all(module.PLOTS, Evidence(root), report) for module in MODULES[gate]]


def test_the_figures_of_gate_a_are_drawn_by_the_level_and_confidence_judged_by(whole, tmp_path):
    _, (pictures, _) = _judged_by_others(whole, tmp_path / "repo", "A")
    drawn = "".join(picture.svg or "" for picture in pictures)
    assert "adjusted p at most 0.013" in drawn and "90%" in drawn and "95%" not in drawn


def test_the_interval_of_success_is_drawn_by_the_confidence_judged_by(whole, tmp_path):
    _, (pictures,) = _judged_by_others(whole, tmp_path / "repo", "D")
    assert any("exact 90% interval" in picture.svg for picture in pictures)


def test_convergence_is_drawn_by_the_confidence_judged_by(whole, tmp_path):
    report, ((picture,), _) = _judged_by_others(whole, tmp_path / "repo", "B")
    low, high = next(c for c in report.criteria if c.id == "baseline_fall_upper").interval
    (row,) = [row for row in picture.in_words if row[0] == "chunked_bc"]
    assert any(cell.endswith(f"({low:.3g} to {high:.3g})") for cell in row)
    assert "90% interval" in picture.svg


@pytest.mark.parametrize(("gate", "module"), [("A", plots_need), ("D", plots_stress)])
def test_without_the_confidence_judged_by_no_interval_is_drawn(whole, gate, module):
    report = judge(whole, gate)
    settings = {key: value for key, value in report.settings.items() if key != "confidence"}
    without = report.model_copy(update={"settings": settings})
    pictures = draw_all(module.PLOTS, Evidence(whole), without)
    assert [picture.skipped for picture in pictures if picture.skipped] == ["'confidence'"]


def test_a_training_that_was_not_measured_at_three_quarters_is_not_drawn(whole, tmp_path):
    root = tmp_path / "repo"
    shutil.copytree(whole, root)
    report = judge(whole, "B")
    name = "train_generators/flow/seed_0/validation.parquet"
    evidence.edit_table(root, name, lambda rows: rows[rows["step"] != 3000])
    (picture,) = draw_all(plots_convergence.PLOTS, Evidence(root), report)
    assert "lacks the loss after" in picture.skipped and not picture.in_words
