"""Fixtures asked in another way: what differs is red and named, what nobody asked is no zero."""

import evidence
import numpy as np
import pandas as pd
import pytest
from asked import asked
from editing import cells

from gates.evidence import Evidence, MissingEvidenceError
from gates.pages.figures import draw_all
from gates.pages.page import gate_page
from gates.pages.tables_variations import LISTING
from gates.proof import judge
from gates.reproducibility.variations import COMPANY, PLAINLY, VARIED, varied_difference
from genpolicy.evidence.reproducibility import variations as asked_for
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
        (lambda f: f.assign(chunks=0), "0 chunks were compared by threads of seed 0, of 16"),
        (cells("chunks", 1, where=of("alone", "tcp_x_m")), "1 chunks were compared by alone"),
        (lambda f: f.assign(seed=1), "each training seed that was drawn"),
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
    with pytest.raises(MissingEvidenceError, match="by threads it can be asked, and was not"):
        said(ladder)


def test_a_training_seed_that_was_asked_in_no_other_way_is_missing(ladder):
    def further(frame):
        return pd.concat([frame, frame[frame["method"] == "flow"].assign(seed=1)])

    evidence.edit_table(ladder, "reload/samples.parquet", further)
    with pytest.raises(MissingEvidenceError, match="each training seed that was drawn"):
        said(ladder)
    evidence.edit_table(ladder, TABLE, further)
    assert "of 2 training seeds" in said(ladder).caveat


def test_of_our_own_it_is_said_that_they_take_one_thread(ladder):
    assert "it takes one thread whatever is set" in said(ladder).caveat


SERVER = {"kind": "server"}
OTHERS = {"kind": "scripted", "stochastic": False}


@pytest.mark.parametrize(
    ("document", "most", "ways"),
    [
        ({}, 4, ()),
        (SERVER, 4, ("threads",)),
        (SERVER, 3, ("threads", "together")),
        (SERVER, 1, ("threads", "alone", "together")),
        (OTHERS, 4, ("threads", "alone", "together")),
    ],
)
def test_unknown_is_what_entry_and_server_say_and_nothing_else(ladder, document, most, ways):
    bring(ladder, unmatched=EXCEPTION, document=document, told={"most_candidates": most})
    for way in ways:
        unknown(ladder, way)
    assert of_flow(judge(ladder, "B"), "varied_difference").verdict == "PASS"
    for way in sorted({*VARIATIONS} - {*ways}):
        before = (ladder / VARIED).read_bytes()
        unknown(ladder, way)
        answer = of_flow(judge(ladder, "B"), "varied_difference")
        assert answer.verdict == "INCONCLUSIVE", way
        assert f"by {way} it can be asked, and was not: cannot be" in answer.caveat
        (ladder / VARIED).write_bytes(before)


def card(**changes):
    return lambda found: found["flow"]["card"].update(changes)


@pytest.mark.parametrize(
    "changes", [{"device": "cuda"}, {"precision": "bfloat16"}, {"precision": "int8"}]
)
def test_another_batch_is_told_where_it_picks_other_kernels_and_the_rest_is_held(ladder, changes):
    bring(ladder, unmatched=EXCEPTION)
    evidence.edit_document(ladder, "reload/identity.json", card(**changes))
    differ(ladder, "alone", 2e-3)
    differ(ladder, "together", 1e-3)
    answer = of_flow(judge(ladder, "B"), "varied_difference")
    assert (answer.verdict, answer.measured) == ("PASS", 0.0)
    assert "not judged, as a batch may pick another kernel on" in answer.caveat
    assert ": alone 0.002" in answer.caveat and ": together 0.001" in answer.caveat
    differ(ladder, "order", 1e-3)
    assert of_flow(judge(ladder, "B"), "varied_difference").verdict == "FAIL"


@pytest.mark.parametrize("precision", ["", "float32", "float64"])
def test_full_precision_on_the_cpu_is_held_to_every_batch(ladder, precision):
    bring(ladder, unmatched=EXCEPTION)
    evidence.edit_document(ladder, "reload/identity.json", card(precision=precision))
    differ(ladder, "alone", 2e-3)
    assert of_flow(judge(ladder, "B"), "varied_difference").verdict == "FAIL"


def test_of_what_is_trained_here_no_device_lets_a_batch_differ(ladder):
    evidence.edit_document(ladder, "reload/identity.json", card(device="cuda"))
    differ(ladder, "alone", 2e-3)
    assert said(ladder).value == 2e-3


def test_the_gate_counts_as_many_as_are_asked_for():
    assert (PLAINLY, COMPANY) == (asked_for.CANDIDATES, asked_for.COMPANY)


def test_of_who_was_brought_some_ways_are_unknown_and_said_and_order_is_not(ladder):
    bring(ladder, unmatched=EXCEPTION, document=SERVER, told={"most_candidates": 1})
    unknown(ladder, "threads", "alone", "together")
    answer = of_flow(judge(ladder, "B"), "varied_difference")
    assert (answer.verdict, answer.measured) == ("PASS", 0.0)
    assert "unknown by threads: cannot be; unknown by alone" in answer.caveat
    unknown(ladder, "order")
    answer = of_flow(judge(ladder, "B"), "varied_difference")
    assert (answer.verdict, answer.measured) == ("INCONCLUSIVE", None)


def test_the_page_has_a_line_of_each_candidate_and_way(ladder):
    differ(ladder, "together", 2e-6, "gripper_opening_m")
    bring(ladder, unmatched=EXCEPTION, document=SERVER)
    unknown(ladder, "threads")
    report = judge(ladder, "B")
    (found,) = draw_all((LISTING,), Evidence(ladder), report)
    lines = {line[:2]: line[2:] for line in found.listed[1:]}
    assert len(lines) == len(VARIATIONS) * len(evidence.CANDIDATES)
    assert lines["flow", "together"] == ("16", "1", "0", "0", "2e-06")
    assert lines["flow", "threads"][:2] == ("unknown", "cannot be")
    assert lines["diffusion", "alone"] == ("8", "0", "0", "0", "0")
    assert LISTING.title in gate_page(ladder, report)
