"""What is measured in every combination of some draws: trainings by starts, and by conditions.

Each training of a method runs from the same starts, so that trainings and starts are crossed: a
start that is hard is hard for all of them, and what one training is worth differs from what the
method is. The interval draws both anew, by Student's t over the means of either: its width squared
is the sum of both widths squared, so that what is noise of single cells counts twice and the
interval is rather too wide. Sources: Searle, Casella and McCulloch 1992, chapter 4 (components from
mean squares of balanced data); Satterthwaite 1946 for sums of mean squares with few degrees of
freedom, in place of which the quantile of each part stands here.

Three trainings are three draws. The interval takes what trainings are worth as normal about their
mean, which three draws cannot check: a method of which one training in ten fails outright mostly
shows three that do not.
"""

import math
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from genpolicy.errors import ContractError, NonFiniteError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Components:
    """Standard deviations of what a rollout is worth, by what it comes from.

    Attributes:
        training: Between trainings of the method.
        start: Between starts.
        condition: Between conditions.
        rest: What is left: noise of the sampler, with whatever the others do only together.
    """

    training: float
    start: float
    condition: float
    rest: float


def mean_width(values: Array, *, alpha: float) -> float:
    """Half the width of an interval of the mean of independent draws, by Student's t.

    Args:
        values: Draws. Shape (n,); one alone has no width that is known.
        alpha: Probability with which either end is wrong, in (0, 1).

    Returns:
        Half of the width; infinite of one draw.
    """
    if len(values) < 2:
        return math.inf
    quantile = float(scipy.stats.t.isf(alpha, len(values) - 1))
    return quantile * float(np.std(values, ddof=1)) / math.sqrt(len(values))


def trainings_width(values: Array, *, alpha: float) -> float:
    """Half the width that trainings give the mean over them, where all ran from the same starts.

    Trainings whose means are closer than the noise of their cells would have them count as apart
    as that noise: so few may lie close by luck.

    Args:
        values: What each training is worth on each start. Shape (trainings, starts).
        alpha: Probability with which either end is wrong, in (0, 1).

    Returns:
        Half of the width; infinite of one training.

    Raises:
        ContractError: Not such a table, or without a start.
        NonFiniteError: A value is NaN or infinite.
    """
    values = _table(values, 2)
    trainings, starts = values.shape
    if trainings < 2 or starts < 2:
        return math.inf
    means = values.mean(axis=1)
    noise = values - means[:, None] - values.mean(axis=0) + values.mean()
    least = float(np.sum(noise**2)) / ((trainings - 1) * (starts - 1) * starts)
    variance = max(float(np.var(means, ddof=1)), least)
    quantile = float(scipy.stats.t.isf(alpha, trainings - 1))
    return quantile * math.sqrt(variance / trainings)


def mean_interval(values: Array, *, alpha: float) -> tuple[float, float, float]:
    """Mean over trainings and starts, and its interval where both are drawn anew.

    Args:
        values: What each training is worth on each start. Shape (trainings, starts).
        alpha: Probability with which either end is wrong, in (0, 1).

    Returns:
        Mean, lower and upper end; infinite ends of one training or one start.

    Raises:
        ContractError: Not such a table.
        NonFiniteError: A value is NaN or infinite.
    """
    values = _table(values, 2)
    width = math.hypot(
        trainings_width(values, alpha=alpha), mean_width(values.mean(axis=0), alpha=alpha)
    )
    mean = float(values.mean())
    return mean, mean - width, mean + width


def gain_of_methods(own: Array, other: Array, *, alpha: float) -> tuple[float, float, float]:
    """Gain of a method over another, over trainings of either and the starts that all share.

    Args:
        own: What each training is worth on each start. Shape (trainings, starts).
        other: The same of the other; one row of what has no training. Shape (trainings, starts).
        alpha: Probability with which either end is wrong, in (0, 1).

    Returns:
        Gain, lower and upper end; infinite ends of one training of `own`, or one start.

    Raises:
        ContractError: Not two tables of the same starts.
        NonFiniteError: A value is NaN or infinite.
    """
    own, other = _table(own, 2), _table(other, 2)
    if own.shape[1] != other.shape[1]:
        raise _refusal(f"{own.shape[1]} starts of one and {other.shape[1]} of the other")
    gains = own.mean(axis=0) - other.mean(axis=0)
    width = math.hypot(trainings_width(own, alpha=alpha), mean_width(gains, alpha=alpha))
    if len(other) > 1:
        width = math.hypot(width, trainings_width(other, alpha=alpha))
    gain = float(gains.mean())
    return gain, gain - width, gain + width


def components(values: Array) -> Components:
    """Where what a rollout is worth comes from: components of variance from mean squares.

    Args:
        values: One rollout in each cell. Shape (trainings, starts, conditions), two each or more.

    Raises:
        ContractError: Not such a table.
        NonFiniteError: A value is NaN or infinite.
    """
    values = _table(values, 3)
    if min(values.shape) < 2:
        raise _refusal(f"a table of {' by '.join(map(str, values.shape))}")
    mean, cells = values.mean(), values.size
    squares = []
    for axis, levels in enumerate(values.shape):
        others = tuple(place for place in range(3) if place != axis)
        apart = float(np.sum((values.mean(axis=others) - mean) ** 2))
        squares.append((apart * cells / levels, levels))
    left = float(np.sum((values - mean) ** 2)) - sum(square for square, _ in squares)
    freedom = cells - 1 - sum(levels - 1 for _, levels in squares)
    rest = max(left, 0.0) / freedom
    found = [
        math.sqrt(max(square / (levels - 1) - rest, 0.0) * levels / cells)
        for square, levels in squares
    ]
    training, start, condition = found
    return Components(training, start, condition, math.sqrt(rest))


def _table(values: Array, dimensions: int) -> Array:
    values = np.asarray(values, dtype=np.float64)
    if values.ndim != dimensions or values.size == 0:
        raise _refusal(f"an array of shape {values.shape}")
    if not np.all(np.isfinite(values)):
        raise NonFiniteError(
            where="what trainings are worth",
            found="with NaN or infinity",
            expected="finite numbers",
            action="Leave out what was not run, and say so.",
        )
    return values


def _refusal(found: str) -> ContractError:
    return ContractError(
        where="what trainings are worth",
        found=found,
        expected="every training on the same starts, under the same conditions, at least two each",
        action="Run what is missing, or leave the training out and say so.",
    )
