"""Thresholds of monitors by exact conformal rank.

A score that is exchangeable with n calibration scores exceeds their order statistic of rank
ceil((n + 1)(1 - alpha)) with probability at most alpha, whatever their distribution. A plain
quantile of n scores has no such guarantee: it is too low by about one rank.

Source:
    Vovk, Gammerman and Shafer, Algorithmic Learning in a Random World, 2.2; Lei et al.,
    arXiv 1604.04173.
"""

import math
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from genpolicy.errors import ContractError, NonFiniteError

Array = NDArray[np.float64]


def conformal_rank(n: int, alpha: float) -> int:
    """Rank of the threshold among n calibration scores, from 1; beyond n none of them is enough.

    Args:
        n: Calibration scores, at least 0.
        alpha: Chance of an alarm that is allowed, between 0 and 1.

    Raises:
        ContractError: Fewer than no scores, or no such chance.
    """
    if n < 0 or not 0.0 < alpha < 1.0:
        raise ContractError(
            where="a conformal rank",
            found=f"n = {n}, alpha = {alpha}",
            expected="n >= 0 and 0 < alpha < 1",
            action="Correct `monitors.alpha`.",
        )
    # Of decimals as they are written: 1 - 0.1 times 10 is 9, not a hair more.
    return math.ceil((n + 1) * (1 - Fraction(str(alpha))))


def conformal_threshold(scores: Array, alpha: float) -> float:
    """The score above which there is an alarm.

    Args:
        scores: One calibration score for each independent episode. Shape (n,).
        alpha: Chance of an alarm in an episode like those, between 0 and 1.

    Returns:
        s_(ceil((n + 1)(1 - alpha))); infinity where n is too small for alpha: then nothing can
        raise an alarm.

    Raises:
        ContractError: No such chance.
        NonFiniteError: A score is NaN or infinite.
    """
    if not np.isfinite(scores).all():
        raise NonFiniteError(
            where="the calibration scores of a monitor",
            found="not finite",
            expected="finite numbers",
            action="Look at the monitor; leave no score out.",
        )
    rank = conformal_rank(len(scores), alpha)
    return float(np.sort(scores)[rank - 1]) if rank <= len(scores) else math.inf
