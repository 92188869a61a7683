"""Was the training done? The figure of Gate B says what the criteria say."""

import evidence
from otherwise import judged_by_others

from gates.evidence import Evidence
from gates.pages.figures import draw_all
from gates.pages.page import gate_page
from gates.pages.plots_convergence import PLOTS


def _stated(report):
    return next(c for c in report.criteria if c.id == "baseline_fall_upper")


def test_it_says_in_words_what_it_draws(whole, judged):
    report = judged("B")
    (picture,) = draw_all(PLOTS, Evidence(whole), report)
    heads, *rows = picture.in_words
    by_method = {row[0]: dict(zip(heads, row, strict=True)) for row in rows}
    limit = _stated(report).threshold
    said = f"{100 * limit:g} %"
    assert f"limit {said}" in picture.svg and said == by_method["chunked_bc"]["its limit"]
    assert by_method["flow"]["its limit"] == "asked by samples"
    low, high = _stated(report).interval
    fall = by_method["chunked_bc"]["fall over the last quarter"]
    assert fall.endswith(f"({100 * low:.3g} to {100 * high:.3g})") and fall.startswith("4 % ")
    for row in by_method.values():
        assert row["from"] in report.materials  # what is drawn is bound
    page = gate_page(whole, report)
    assert page.count("The same as a table") == 4 and f'<td class="n">{fall}</td>' in page


def test_it_is_drawn_by_the_confidence_judged_by(copied):
    report, (picture,) = judged_by_others(copied, "B", PLOTS)
    low, high = _stated(report).interval
    (row,) = [row for row in picture.in_words if row[0] == "chunked_bc"]
    assert any(cell.endswith(f"({100 * low:.3g} to {100 * high:.3g})") for cell in row)
    assert "90 % interval" in picture.svg


def test_a_training_that_was_not_measured_at_three_quarters_is_not_drawn(copied, judged):
    name = "train_generators/flow/seed_0/validation.parquet"
    evidence.edit_table(copied, name, lambda rows: rows[rows["updates"] != 3000])
    (picture,) = draw_all(PLOTS, Evidence(copied), judged("B"))
    assert "lacks the loss after" in picture.skipped and not picture.in_words
