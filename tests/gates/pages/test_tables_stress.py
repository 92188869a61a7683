"""Splices at Gate D: by method and rule, before and after projection; what is not there is said."""

import evidence
import numpy as np

from gates.evidence import Evidence
from gates.pages.figures import draw_all
from gates.pages.page import gate_page
from gates.pages.tables_stress import FILE, LISTINGS

TABLE = FILE.removeprefix("artifacts/")
ROWS = 3 * evidence.STARTS


def drawn(root, report):
    (found,) = draw_all(LISTINGS, Evidence(root), report)
    return found


def quantiles(values):
    middle, high = np.quantile(np.array(values), [0.5, 0.95], method="higher")
    return f"{middle:.3g}, p95 {high:.3g}"


def test_each_method_stands_with_its_rule_and_with_both_ends_of_projection(whole, judged):
    found = drawn(whole, judged("D"))
    assert found.skipped == ""
    heads, *lines = found.listed
    assert heads[:4] == ("method", "joined by", "chunks", "with a say of earlier ones")
    told = {line[0]: line[1:] for line in lines}
    assert set(told) == {*evidence.COMPARED, *evidence.CANDIDATES}
    conditions = len(evidence.CONDITIONS)
    steps = [start + number for start in range(evidence.STARTS) for number in range(3)]
    later = [start + number for start in range(evidence.STARTS) for number in (1, 2)]
    assert told["flow"] == (
        "real_time", f"{conditions * ROWS}", f"{conditions * 2 * evidence.STARTS}",
        quantiles([1.0 * n for n in steps]), quantiles([0.5 * n for n in steps]),
        quantiles([100.0 * n for n in later]), quantiles([50.0 * n for n in later]),
    )  # fmt: skip
    assert told["act"][:3] == ("replace", f"{conditions * ROWS}", "0")


def test_every_condition_has_a_line_and_the_page_shows_them(whole, judged):
    found = drawn(whole, judged("D"))
    ((title, lines),) = found.folded
    assert title == "Every condition"
    assert len(lines) == 1 + len(told_methods()) * len(evidence.CONDITIONS)
    assert "Splices" in gate_page(whole, judged("D"))


def told_methods():
    return {*evidence.COMPARED, *evidence.CANDIDATES}


def test_a_table_that_is_not_the_report_s_is_not_shown(ladder, judged):
    evidence.edit_table(ladder, TABLE, lambda frame: frame.head(1))
    assert "is not the file that the report names" in drawn(ladder, judged("D")).skipped
