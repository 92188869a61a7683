"""Paired betting e-process: may the candidate be promoted, looked at after any number of pairs?

D_i is the utility of the candidate minus that of the baseline on the same start. Against
H0: E[D] <= margin, every wager lambda in (0, 1 / (1 + margin)) makes
prod(1 + lambda (D_i - margin)) a non-negative supermartingale of start 1; so is the average over
a grid. By Ville's inequality it exceeds 1 / alpha with probability at most alpha, whenever one
looks. Source: Waudby-Smith and Ramdas 2024; Shafer and Vovk 2001.
"""

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from genpolicy.errors import ContractError

Array = NDArray[np.float64]

WAGER_SHARES = (0.35, 0.45, 0.55, 0.65, 0.75, 0.85)
"""Wagers as shares of the largest, 1 / (1 + margin). Log-optimal wagers of gains of 0.15 to 0.5
beyond the margin lie here; what is staked below and above buys no power at a hundred pairs."""
MARGINS = tuple(float(step) / 1000.0 for step in range(-999, 1000))


@dataclass(frozen=True)
class EProcess:
    """The evidence of paired differences.

    Attributes:
        path: Evidence after each pair. Shape (n,).
        decision: `promote` once the path has reached 1 / alpha, else `continue`.
        pairs_needed: Pairs at which it first did; None if never.
        e_value: Largest evidence so far; 1 without pairs.
    """

    path: Array
    decision: Literal["promote", "continue"]
    pairs_needed: int | None
    e_value: float


@dataclass(frozen=True)
class PowerRow:
    """What the pre-registered test does in one assumed world.

    Attributes:
        baseline_success: Assumed success probability of the baseline.
        candidate_success: Assumed success probability of the candidate.
        correlation: Share of starts whose difficulty is common to both methods.
        margin: Margin of the test.
        pairs: Maximum number of pairs.
        promote_share: Share of simulated trials that end in `promote`.
        return_share: Share that end without promotion.
        median_pairs: Median pairs at promotion; None if no trial promoted.
    """

    baseline_success: float
    candidate_success: float
    correlation: float
    margin: float
    pairs: int
    promote_share: float
    return_share: float
    median_pairs: float | None


def paired_e_value(differences: Array, *, margin: float, alpha: float) -> EProcess:
    """Evidence that the mean difference exceeds the margin.

    Args:
        differences: Candidate minus baseline on the same start, in the order in which they were
            planned, each in [-1, 1]. Shape (n,).
        margin: Gain to be shown, in (-1, 1); negative for non-inferiority.
        alpha: Probability of a wrong promotion, in (0, 1).

    Returns:
        Path and decision. The mirrored question (is it worse?) is
        `paired_e_value(-differences, margin=-margin, alpha=alpha)`.

    Raises:
        ContractError: A value outside its range, or NaN.
    """
    d = np.asarray(differences, dtype=np.float64)
    _check(d, margin, alpha)
    path = _paths(d[None, :], margin)[0]
    reached = np.flatnonzero(path >= 1.0 / alpha)
    return EProcess(
        path=path,
        decision="promote" if len(reached) else "continue",
        pairs_needed=int(reached[0]) + 1 if len(reached) else None,
        e_value=float(path.max()) if len(path) else 1.0,
    )


def highest_e_value(differences: Array, *, margin: float, left: int) -> float:
    """The largest evidence that pairs can still lead to, whatever the rest of them show.

    A factor of the process grows with its difference, so that no rest leads to more evidence than
    one in which the candidate has all that there is, 1, on each pair.

    Args:
        differences: Those that are known, as of `paired_e_value`. Shape (n,).
        margin: Gain to be shown, in (-1, 1).
        left: Pairs that are still to come, not below 0.

    Returns:
        At least the largest evidence so far; it falls, or stays, with every pair that is known.

    Raises:
        ContractError: A value outside its range, or NaN.
    """
    d = np.asarray(differences, dtype=np.float64)
    _check(d, margin, 0.5)
    path = _paths(np.concatenate([d, np.ones(left)])[None, :], margin)[0]
    return float(path.max()) if len(path) else 1.0


def gain_interval(differences: Array, *, alpha: float) -> tuple[float, float]:
    """The gains that the pairs do not speak against, on either side, whenever one looks.

    The lower end is the largest margin that is shown to be exceeded, the upper end likewise of the
    mirrored question.

    Args:
        differences: As of `paired_e_value`. Shape (n,).
        alpha: Probability with which an end is wrong, each, in (0, 1).

    Returns:
        Lower and upper end, to a thousandth; -1 and 1 where nothing is shown.

    Raises:
        ContractError: A value outside its range, or NaN.
    """
    d = np.asarray(differences, dtype=np.float64)
    return _shown(d, alpha), -_shown(-d, alpha)


def _shown(differences: Array, alpha: float) -> float:
    """The largest margin of a grid that is exceeded; -1 if none is.

    Evidence only falls with the margin, since (D - margin) / (1 + margin) does.
    """
    exceeded = bisect_left(
        MARGINS,
        True,
        key=lambda margin: (
            paired_e_value(differences, margin=margin, alpha=alpha).decision != "promote"
        ),
    )
    return MARGINS[exceeded - 1] if exceeded else -1.0


def power_table(
    scenarios: Sequence[tuple[float, float]],
    *,
    margin: float,
    alpha: float,
    pairs: int,
    correlation: float,
    trials: int,
    rng: np.random.Generator,
) -> list[PowerRow]:
    """Simulated verdicts of the test for assumed success probabilities.

    Args:
        scenarios: Pairs (baseline success, candidate success).
        margin: Margin of the test.
        alpha: Probability of a wrong promotion.
        pairs: Maximum number of pairs, as pre-registered.
        correlation: Share of starts on which one draw decides for both methods.
        trials: Simulated trials per scenario.
        rng: Generator of the simulation.

    Returns:
        One row per scenario. The test can reach both verdicts where some row has
        `promote_share` and another `return_share` well above zero.
    """
    _check(np.zeros(1), margin, alpha)
    rows = []
    for baseline, candidate in scenarios:
        d = simulate_pairs(
            baseline, candidate, correlation=correlation, shape=(trials, pairs), rng=rng
        )
        reached = _paths(d, margin) >= 1.0 / alpha
        promoted = reached.any(axis=1)
        first = reached.argmax(axis=1)[promoted] + 1
        rows.append(
            PowerRow(
                baseline_success=baseline,
                candidate_success=candidate,
                correlation=correlation,
                margin=margin,
                pairs=pairs,
                promote_share=float(promoted.mean()),
                return_share=float(1.0 - promoted.mean()),
                median_pairs=float(np.median(first)) if len(first) else None,
            )
        )
    return rows


def simulate_pairs(
    baseline_success: float,
    candidate_success: float,
    *,
    correlation: float,
    shape: tuple[int, int],
    rng: np.random.Generator,
) -> Array:
    """Differences of two Bernoulli outcomes that share the start's difficulty. Shape `shape`."""
    own, other = rng.random(shape), rng.random(shape)
    other = np.where(rng.random(shape) < correlation, own, other)
    return (own < candidate_success).astype(np.float64) - (other < baseline_success)


def _paths(differences: Array, margin: float) -> Array:
    """Evidence paths of several trials. Shape (trials, n) to (trials, n)."""
    wagers = [share / (1.0 + margin) for share in WAGER_SHARES]
    logs = np.stack(
        [np.cumsum(np.log1p(wager * (differences - margin)), axis=1) for wager in wagers]
    )
    top = logs.max(axis=0)
    return np.asarray(np.exp(top + np.log(np.mean(np.exp(logs - top), axis=0))))


def _check(differences: Array, margin: float, alpha: float) -> None:
    for where, ok, found, expected in (
        ("the differences", bool(np.all(np.abs(differences) <= 1.0)), "outside", "in [-1, 1]"),
        ("margin", -1.0 < margin < 1.0, repr(margin), "in (-1, 1)"),
        ("alpha", 0.0 < alpha < 1.0, repr(alpha), "in (0, 1)"),
    ):
        if not ok:
            raise ContractError(
                where=where,
                found=found,
                expected=expected,
                action="Scale utilities to [0, 1]; a trial without an outcome is an error.",
            )
