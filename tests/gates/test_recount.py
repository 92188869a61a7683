"""What a criterion filters by is what it says, and what it says is counted by it."""

import pandas as pd
import pytest

from gates.evidence import MissingEvidenceError
from gates.recount import (
    AtLeast,
    Differs,
    NotAll,
    Subset,
    all_hold,
    is_none,
    is_one,
    part_said,
    part_share,
)

FRAME = pd.DataFrame(
    {
        "method": "flow",
        "mode": ["left", "right", "", "left"],
        "passed": [True, False, None, True],
        "valid": [3, 4, 4, 0],
        "samples": [4, 4, 4, 4],
        "label": ["a", "a", "b", "b"],
        "replayed": ["a", "b", "b", "a"],
    }
)


@pytest.mark.parametrize(
    ("term", "said", "holds"),
    [
        (is_one("mode", "left"), "mode = left", [1, 0, 0, 1]),
        (is_one("mode", "left", "right"), "mode = left or right", [1, 1, 0, 1]),
        (is_one("mode", ""), "mode = (empty)", [0, 0, 1, 0]),
        (is_none("mode", "left", "right"), "mode ≠ left or right", [0, 0, 1, 0]),
        (is_one("passed", True), "passed = true", [1, 0, 0, 1]),
        (is_one("passed", False), "passed = false", [0, 1, 0, 0]),
        (is_one("valid", 4), "valid = 4", [0, 1, 1, 0]),
        (AtLeast("valid", 3), "valid >= 3", [1, 1, 1, 0]),
        (AtLeast("valid", "samples"), "valid >= samples", [0, 1, 1, 0]),
        (AtLeast("valid", "samples", 0.75), "valid >= 0.75 * samples", [1, 1, 1, 0]),
        (Differs("label", "replayed"), "label ≠ replayed", [0, 1, 0, 1]),
        (
            NotAll((is_one("mode", "left"), is_one("passed", True))),
            "not (mode = left and passed = true)",
            [0, 1, 1, 0],
        ),
    ],
)
def test_a_term_holds_where_it_says(term, said, holds):
    assert (str(term), term.holds(FRAME).tolist()) == (said, [bool(one) for one in holds])
    assert set(term.columns) <= set(FRAME)


def test_no_term_holds_everywhere():
    assert all_hold((), FRAME).all() and len(all_hold((), FRAME[:0])) == 0


def test_rows_and_hits_are_those_of_the_terms():
    subset = Subset("a.parquet", (is_one("mode", "left"),))
    rows = subset.of(FRAME)
    found = subset.counted(rows, AtLeast("valid", 3))
    assert (found.table, found.method, found.where) == ("a.parquet", "flow", ("mode = left",))
    assert (found.whole, found.part, found.hits) == (2.0, 1.0, ("valid >= 3",))
    assert (found.columns, found.of, found.summed) == (("mode", "valid"), "", ())
    assert subset.counted(rows).part is None, "rows alone"


def test_sums_are_those_of_the_columns():
    subset = Subset("a.parquet")
    found = subset.summed(subset.of(FRAME), ("valid",), "samples")
    assert (found.part, found.whole, found.of, found.summed) == (11.0, 16.0, "samples", ("valid",))
    assert (found.where, found.columns) == ((), ("valid", "samples"))


def test_a_share_is_of_what_was_counted_and_of_rows_alone_there_is_none():
    subset = Subset("a.parquet")
    found = subset.counted(FRAME, AtLeast("valid", 3))
    assert (part_share(found), part_said(found, "rows")) == (0.75, "75 % (3 of 4 rows)")
    assert part_said(subset.counted(FRAME, AtLeast("valid", 9)), "") == "0 % (none of 4)"
    for ask in (part_share, lambda rows: part_said(rows, "rows")):
        with pytest.raises(AssertionError, match="rows alone"):
            ask(subset.counted(FRAME))


def test_of_several_methods_no_one_is_named():
    frame = FRAME.assign(method=["flow", "act", "act", "act"])
    assert Subset("a.parquet").counted(frame).method == ""
    assert Subset("a.parquet").counted(frame.drop(columns="method")).method == ""


def test_a_number_that_is_none_is_no_hit_and_no_miss():
    frame = FRAME.assign(valid=[1.0, None, 2.0, 3.0])
    with pytest.raises(MissingEvidenceError, match="valid"):
        AtLeast("valid", 1).holds(frame)
    with pytest.raises(MissingEvidenceError, match="passed"):
        is_one("passed", True).holds(frame.assign(passed="yes"))
