"""Are two small samples of positive numbers alike up to a factor? Two one-sided tests on logs.

The ratio of geometric means with its interval of Student's t (Schuirmann 1987, as for
bioequivalence): alike within a limit is shown where the whole interval lies within it. What such
a comparison can find is stated beside it: the spread at which four of five equal pairs pass.
"""

import math

import numpy as np
import scipy
from numpy.typing import NDArray

from genpolicy.errors import ContractError

Array = NDArray[np.float64]
FEWEST = 2
NEGLIGIBLE = 1e-12


def ratio_of_means(first: Array, second: Array, *, confidence: float) -> tuple[float, float, float]:
    """Geometric mean of `first` over that of `second`, with the interval of Student's t on logs.

    Args:
        first: Positive numbers, independent of each other. Shape (n,), n >= 2.
        second: Likewise; the same spread is assumed. Shape (m,), m >= 2.
        confidence: Coverage.

    Returns:
        Ratio, lower and upper end.

    Raises:
        ContractError: Fewer than two, or a value that is not positive and finite.
    """
    logs = [_logs(values) for values in (first, second)]
    freedom = len(first) + len(second) - 2
    squares = sum(float(np.sum((part - part.mean()) ** 2)) for part in logs)
    error = math.sqrt(squares / freedom * (1.0 / len(first) + 1.0 / len(second)))
    middle = float(logs[0].mean() - logs[1].mean())
    return _interval(middle, error, freedom, confidence)


def ratio_to(values: Array, reference: Array, *, confidence: float) -> tuple[float, float, float]:
    """Geometric mean of `values` over their references, pair by pair; otherwise `ratio_of_means`.

    Args:
        values: Positive numbers, independent of each other. Shape (n,), n >= 2.
        reference: What each is held against. Shape (n,).
        confidence: Coverage.

    Returns:
        Ratio, lower and upper end.

    Raises:
        ContractError: As `ratio_of_means`, or other lengths.
    """
    if len(values) != len(reference):
        raise _refusal(f"{len(values)} values and {len(reference)} references")
    rest = _logs(values) - _logs(reference)
    error = float(rest.std(ddof=1)) / math.sqrt(len(rest))
    return _interval(float(rest.mean()), error, len(rest) - 1, confidence)


def spread_found(limit: float, count: int, *, confidence: float, power: float = 0.8) -> float:
    """Spread up to which two samples that do not differ are found alike with this power.

    Args:
        limit: Largest factor that counts as alike, > 1.
        count: Values in each of the two samples, >= 2.
        confidence: Coverage of the interval that is held against the limit.
        power: Share of such comparisons that are found alike.

    Returns:
        Standard deviation of the natural logarithm.
    """
    reach = math.log(limit)

    def short(spread: float) -> float:
        return share_found(spread, limit, count, confidence=confidence) - power

    return float(scipy.optimize.brentq(short, reach * 1e-3, reach * 10.0))


def share_found(spread: float, limit: float, count: int, *, confidence: float) -> float:
    """Share of comparisons of two samples that do not differ whose interval lies in the limit.

    The estimated spread is chi-squared and independent of the difference of means, so that the
    share is one integral.

    Args:
        spread: Standard deviation of the natural logarithm, > 0.
        limit: Largest factor that counts as alike, > 1.
        count: Values in each of the two samples, >= 2.
        confidence: Coverage of the interval.
    """
    freedom = 2 * count - 2
    quantile = float(scipy.stats.t.isf((1.0 - confidence) / 2.0, freedom))
    error = spread * math.sqrt(2.0 / count)
    reach = math.log(limit)

    def density(squares: float) -> float:
        rest = reach - quantile * error * math.sqrt(squares / freedom)
        inside = 2.0 * scipy.stats.norm.cdf(rest / error) - 1.0
        return float(inside * scipy.stats.chi2.pdf(squares, freedom))

    most = min(
        freedom * (reach / (quantile * error)) ** 2,
        float(scipy.stats.chi2.isf(NEGLIGIBLE, freedom)),
    )
    return float(scipy.integrate.quad(density, 0.0, most, limit=200)[0])


def _interval(
    middle: float, error: float, freedom: int, confidence: float
) -> tuple[float, float, float]:
    reach = float(scipy.stats.t.isf((1.0 - confidence) / 2.0, freedom)) * error
    return math.exp(middle), math.exp(middle - reach), math.exp(middle + reach)


def _logs(values: Array) -> Array:
    numbers = np.asarray(values, dtype=np.float64)
    if len(numbers) < FEWEST or not bool(np.all(np.isfinite(numbers) & (numbers > 0.0))):
        raise _refusal(f"{numbers[:6].tolist()}")
    return np.log(numbers)


def _refusal(found: str) -> ContractError:
    return ContractError(
        where="a ratio of means",
        found=found,
        expected="at least two positive, finite numbers on either side",
        action="Measure in more processes, or look at what took no time.",
    )
