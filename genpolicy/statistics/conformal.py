"""Conformal threshold by the rank rule (Vovk et al. 2005; split conformal).

A plain quantile of the calibration scores raises more false alarms than stated; the rank rule
holds the rate exactly for exchangeable scores.
"""

import math

import numpy as np
from numpy.typing import NDArray

from genpolicy.errors import ContractError, NonFiniteError

Array = NDArray[np.float64]


def conformal_threshold(scores: Array, alpha: float) -> float:
    """The score above which a new exchangeable episode lies with probability at most `alpha`.

    Args:
        scores: One score per calibration episode (its maximum over time). Shape (n,).
        alpha: False alarm rate, between 0 and 1.

    Returns:
        Order statistic of rank ceil((n + 1) (1 - alpha)); inf when that rank exceeds n.

    Raises:
        ContractError: `alpha` outside (0, 1).
        NonFiniteError: A score is NaN.
    """
    if not 0.0 < alpha < 1.0:
        raise ContractError(
            where="alpha",
            found=repr(alpha),
            expected="a number between 0 and 1, ends excluded",
            action="Correct the setting.",
        )
    if np.any(np.isnan(scores)):
        raise NonFiniteError(
            where="the calibration scores",
            found="with NaN",
            expected="numbers",
            action="Find the episode without a score; do not drop it.",
        )
    n = len(scores)
    rank = math.ceil((n + 1) * (1.0 - alpha) - 1e-12)
    return math.inf if rank > n else float(np.sort(scores)[rank - 1])
