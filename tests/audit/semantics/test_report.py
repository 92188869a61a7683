"""Findings in the order of diagnosis, and lists of names that stay short."""

import numpy as np
import pytest

from genpolicy.audit.rows import Finding
from genpolicy.audit.semantics.report import KINDS, in_order, listed


def finding(kind, variable="arm"):
    return Finding(kind, variable, "everywhere", "", 1.0, 0.5, "s", "Look.")


def test_a_unit_is_told_before_a_clock_and_equal_kinds_keep_their_order():
    found = in_order([finding("clock", "b"), finding("calibration"), finding("clock", "a"),
                      finding("unit")])  # fmt: skip
    assert [(f.kind, f.variable) for f in found] == [
        ("unit", "arm"), ("clock", "b"), ("clock", "a"), ("calibration", "arm"),
    ]  # fmt: skip
    assert [f.kind for f in in_order([finding(kind) for kind in reversed(KINDS)])] == list(KINDS)


def test_a_kind_that_has_no_place_is_an_error():
    with pytest.raises(ValueError, match="not in tuple"):
        in_order([finding("gremlin")])


def test_three_names_are_listed_and_the_rest_counted():
    names = np.array([f"ep{n}" for n in range(5)])
    assert listed(names[:3]) == "ep0, ep1, ep2"
    assert listed(names) == "ep0, ep1, ep2 and 2 more"
