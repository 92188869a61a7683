"""Numbers that are none hold no limit."""

import math
from dataclasses import replace

import pytest
from planted import OFFSET, VALID, named

from gates.cause import (
    CauseName,
)
from gates.cause.numbers import Kept


@pytest.mark.parametrize(
    "numbers",
    [replace(VALID, findings=(replace(OFFSET, measured=math.nan),)),
     replace(VALID, kept=Kept(math.nan, 0.6, 118)),
     replace(VALID, modes=tuple(replace(m, admissible=math.nan) for m in VALID.modes))],
)  # fmt: skip
def test_a_number_that_is_none_holds_no_limit(numbers):
    assert named(numbers).name is not CauseName.VALID_MODES
