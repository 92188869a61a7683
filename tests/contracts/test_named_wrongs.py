"""The wrongs that were written down by hand stand in modules of today."""

from collections import Counter

import pytest

from benchmarks.mutation.named import NAMED, Named
from benchmarks.mutation.plan import tests_of as asked_of


@pytest.mark.parametrize("row", NAMED, ids=lambda row: row.wrong)
def test_a_wrong_by_hand_is_one_change_that_compiles(row):
    compile(row.text, row.path, "exec")
    assert row.true != row.changed
    assert asked_of(row.path)


def test_each_wrong_is_another_one():
    assert max(Counter(row.wrong for row in NAMED).values()) == 1
    assert len({(row.path, row.text) for row in NAMED}) == len(NAMED)


@pytest.mark.parametrize("true", ["a text that is nowhere", "def "])
def test_a_change_of_a_text_that_is_not_there_once_is_refused(true):
    with pytest.raises(ValueError, match="not once"):
        assert Named("", "gates/bounds.py", true, "").text
