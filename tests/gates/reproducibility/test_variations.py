"""Fixtures asked in another way: what differs is red and named, what nobody asked is no zero."""

import evidence
import numpy as np
import pytest
from asked import asked
from editing import cells

from gates.evidence import Evidence, MissingEvidenceError
from gates.pages.figures import draw_all
from gates.pages.page import gate_page
from gates.pages.tables_variations import LISTING
from gates.proof import judge
from gates.reproducibility.variations import VARIED, varied_difference
from genpolicy.evidence.rows.reproducibility import VARIATIONS
from tests.gates.reproducibility.test_brought import EXCEPTION, bring, of_flow

TABLE = VARIED.removeprefix("artifacts/")


def of(way, component=None):
    return lambda frame: (
        (frame["method"] == "flow")
        & (frame["variation"] == way)
        & ((frame["component"] == component) | (component is None))
    )


def differ(root, way, by, component=None, chunks=1):
    for column, value in (("max_abs_difference", by), ("unequal", chunks)):
        evidence.edit_table(root, TABLE, cells(column, value, where=of(way, component)))


def unknown(root, *ways):
    for way in ways:
        for column, value in (
            ("max_abs_difference", None), ("unequal", 0), ("chunks", 0), ("unknown", "cannot be"),
        ):  # fmt: skip
            evidence.edit_table(root, TABLE, cells(column, value, where=of(way)))


def said(root):
    return asked(root, varied_difference, "flow", gate="B")


@pytest.mark.parametrize("way", VARIATIONS)
def test_a_sample_that_another_way_changes_is_red_alone_and_named(ladder, way):
    assert said(ladder).value == 0.0
    differ(ladder, way, 1e-3, "tcp_z_m")
    found = said(ladder)
    assert found.value == 1e-3 and f"most by {way}, in tcp_z_m" in found.caveat
    report = judge(ladder, "B")
    assert report.candidates == {"diffusion": "PASS", "flow": "FAIL"}
    assert {item.id for item in report.criteria if item.verdict == "FAIL"} == {"varied_difference"}


def test_another_rounding_passes_and_is_told(ladder):
    differ(ladder, "threads", -3e-7, "rotation_column_0_x", chunks=4)
    found = said(ladder)
    assert found.value == 3e-7 and "threads 4 of 16" in found.caveat
    assert judge(ladder, "B").candidates["flow"] == "PASS"


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (lambda f: f[~of("alone")(f)], "each way once"),
        (lambda f: f[~of("order", "gripper_opening_m")(f)], "each way once"),
        (lambda f: f.assign(component=f["component"].replace("tcp_x_m", "tcp_y_m")), "each way"),
        (lambda f: f.assign(chunks=0), "no chunk was compared"),
        (cells("unequal", 1, where=of("order")), "differ by nothing"),
        (cells("max_abs_difference", 0.1, where=of("order")), "differ by something"),
        (cells("max_abs_difference", np.nan, where=of("order")), "non-finite"),
    ],
)  # fmt: skip
def test_what_was_not_compared_is_no_zero(ladder, change, why):
    evidence.edit_table(ladder, TABLE, change)
    with pytest.raises(MissingEvidenceError, match=why):
        said(ladder)


def test_what_is_trained_here_can_be_asked_in_every_way(ladder):
    unknown(ladder, "threads")
    with pytest.raises(MissingEvidenceError, match="trained here can be asked in every way"):
        said(ladder)


def test_of_who_was_brought_some_ways_are_unknown_and_said_and_order_is_not(ladder):
    bring(ladder, unmatched=EXCEPTION)
    unknown(ladder, "threads", "alone", "together")
    answer = of_flow(judge(ladder, "B"), "varied_difference")
    assert (answer.verdict, answer.measured) == ("PASS", 0.0)
    assert "unknown by threads: cannot be; unknown by alone" in answer.caveat
    unknown(ladder, "order")
    answer = of_flow(judge(ladder, "B"), "varied_difference")
    assert (answer.verdict, answer.measured) == ("INCONCLUSIVE", None)


def test_the_page_has_a_line_of_each_candidate_and_way(ladder):
    differ(ladder, "together", 2e-6, "gripper_opening_m")
    bring(ladder, unmatched=EXCEPTION)
    unknown(ladder, "threads")
    report = judge(ladder, "B")
    (found,) = draw_all((LISTING,), Evidence(ladder), report)
    lines = {line[:2]: line[2:] for line in found.listed[1:]}
    assert len(lines) == len(VARIATIONS) * len(evidence.CANDIDATES)
    assert lines["flow", "together"] == ("16", "1", "0", "0", "2e-06")
    assert lines["flow", "threads"][:2] == ("unknown", "cannot be")
    assert lines["diffusion", "alone"] == ("8", "0", "0", "0", "0")
    assert LISTING.title in gate_page(ladder, report)
