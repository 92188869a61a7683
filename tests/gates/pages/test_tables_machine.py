"""What else ran while latency was measured: the busiest process of each run, or unknown."""

import evidence
import numpy as np
import pytest

from gates.evidence import Evidence
from gates.pages.figures import draw_all
from gates.pages.page import gate_page
from gates.pages.tables_machine import BESIDE, FILE, HEADS
from gates.proof import judge

TABLE = FILE.removeprefix("artifacts/")


def lines_of(root):
    report = judge(root, "B")
    assert FILE in report.materials
    (found,) = draw_all((BESIDE,), Evidence(root), report)
    heads, *lines = found.listed
    assert heads == HEADS
    return {line[:2]: line[2:] for line in lines}


def test_the_busiest_process_of_each_run_stands_there(ladder):
    evidence.edit_table(
        ladder, TABLE, lambda f: f.assign(seconds=4.0, others_s=2.0 * f["process"], stolen_s=0.4)
    )
    found = lines_of(ladder)
    # By hand: 6 s of others in 4 s; turns 3 * 2 + (1, 2, 3) taken and 3 * 40 given.
    assert found["flow", "2"] == ("1.5 of 2", "0.1 of 2", "24", "120")
    assert ("bc", "1") in found
    assert BESIDE.title in gate_page(ladder, judge(ladder, "B"))


@pytest.mark.parametrize(("column", "place"), [("others_s", 0), ("stolen_s", 1)])
def test_what_nobody_counted_is_unknown(ladder, column, place):
    evidence.edit_table(
        ladder, TABLE,
        lambda f: f.assign(**{column: f[column].mask(f["process"] == 2, np.nan)}),
    )  # fmt: skip
    found = lines_of(ladder)["flow", "1"]
    assert found[place] == "unknown" and found[1 - place] != "unknown"
