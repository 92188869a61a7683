"""A context without rows or numbers is refused."""

from dataclasses import replace

import numpy as np
import pytest

from genpolicy.errors import ContractError, NonFiniteError


def test_a_context_with_nan_or_a_negative_first_row_is_refused(checker, kit):
    ctx = kit.context(checker, kit.START)
    with pytest.raises(NonFiniteError, match="state of the robot is unknown"):
        replace(ctx, q_cmd=np.full(7, np.nan))
    with pytest.raises(ContractError, match="first_index is -1"):
        replace(ctx, first_index=-1)
