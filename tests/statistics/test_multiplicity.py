"""Holm: golden values, order, error of the family by simulation."""

import numpy as np
import pytest

from genpolicy.errors import ContractError
from genpolicy.seeds import stream
from genpolicy.statistics.multiplicity import holm


def test_holm_golden_and_order():
    # Worked by hand: sorted .01 .02 .03 .04 -> factors 4 3 2 1, running maximum.
    assert holm(np.array([0.04, 0.01, 0.03, 0.02])) == pytest.approx([0.06, 0.04, 0.06, 0.06])
    assert holm(np.array([])).shape == (0,)
    with pytest.raises(ContractError):
        holm(np.array([np.nan]))


def test_holm_controls_the_family_error():
    rng = stream(3, "holm")
    wrong = np.mean([np.any(holm(rng.random(8)) <= 0.05) for _ in range(2000)])
    assert wrong <= 0.065
