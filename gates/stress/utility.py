"""What a rollout is worth to the paired test: its success, less what that took.

u = success (1 - sum of w_k c_k), with costs c_k in [0, 1] and weights w_k whose sum is at most
1 - LEAST_OF_A_SUCCESS. So a failure is worth 0 however cheap it was, a success at least that
floor, and without weights u is success itself.

The test needs nothing else. D, the mean of u of a start minus that of the baseline, is in
[-1, 1] as that of successes is. With a wager 0 < l < 1 / (1 + margin) a factor 1 + l (D - margin)
is at least 1 - l (1 + margin) > 0, and where E[D | what went before] <= margin its expectation is
at most 1: so the product is a non-negative supermartingale of start 1, the mean over a grid of
wagers is one, and Ville's inequality holds whenever one looks (Waudby-Smith and Ramdas 2024,
for means of bounded outcomes; Shafer and Vovk 2001). That outcomes are 0 or 1 is used nowhere. The
margin is in the unit of u.

Outcomes of 0 and 1 are the hardest of their means: with each u replaced by a coin of probability
u, a factor has, given all u, the same expectation and, log being concave, no larger expected
logarithm. So the coins by which a power is simulated grow no more evidence than graded outcomes.
"""

import numpy as np
import pandas as pd

from gates.evidence import Array, Evidence, MissingEvidenceError, flags, numbers
from gates.stress.recoveries import ROLLOUT, recoveries
from gates.stress.rollouts import STRESS, StressSettings, rollouts
from gates.stress.weights import DURATION, FALLBACK, RECOVERY, by_cost


def utilities(
    evidence: Evidence,
    settings: StressSettings,
    method: str,
    rows: pd.DataFrame,
    *,
    folder: str = STRESS,
) -> Array:
    """What each rollout of a method is worth, in [0, 1]; its success where nothing is weighed.

    Args:
        evidence: Of the comparison.
        settings: With the weights.
        method: Whose rollouts these are.
        rows: Rollouts of it. Shape (n,).
        folder: Where they lie.

    Raises:
        MissingEvidenceError: A cost of a success lies outside of the rollout, or, where recovery
            is weighed, as `recoveries`.
    """
    won = flags(rows, "success")
    worth: Array = won.astype(np.float64)
    for cost, weight in by_cost(settings.utility).items():
        share = _seconds(evidence, settings, rows, cost, folder) / settings.longest_s
        if not np.all((share[won] >= 0.0) & (share[won] <= 1.0 + 1e-9)):
            raise MissingEvidenceError(
                f"{method}: a success cost more {cost} than a rollout of {settings.longest_s:g} s "
                "has, or less than none"
            )
        worth -= weight * np.where(won, np.minimum(share, 1.0), 0.0)
    return worth


def mean_worth(
    evidence: Evidence, settings: StressSettings, method: str, rows: pd.DataFrame
) -> float:
    """What the rollouts of a method are worth on average; by this the best simple one is named.

    Raises:
        MissingEvidenceError: As `utilities`.
    """
    return float(utilities(evidence, settings, method, rows).mean())


def mean_worths(evidence: Evidence, settings: StressSettings) -> dict[str, float]:
    """What each simple method is worth over all planned conditions, as pairs are compared.

    Raises:
        MissingEvidenceError: As `utilities`, or one was not run under every condition, as often as
            planned.
    """
    rows = {method: rollouts(evidence, settings, method) for method in settings.baselines}
    return {method: mean_worth(evidence, settings, method, of) for method, of in rows.items()}


def _seconds(
    evidence: Evidence, settings: StressSettings, rows: pd.DataFrame, cost: str, folder: str
) -> Array:
    """How much of a cost each rollout of one method had, s. Shape (n,)."""
    method = str(rows["method"].iloc[0])
    lasted = numbers(rows, "duration_s")
    if cost == DURATION:
        return lasted
    if cost == FALLBACK:
        ticks, driven = numbers(rows, "ticks"), numbers(rows, "fallback_ticks")
        if not np.all((ticks > 0) & (driven <= ticks)):
            raise MissingEvidenceError(f"{method}: fallback_ticks is no part of ticks")
        return lasted * driven / ticks
    assert cost == RECOVERY, "every cost has its time"
    entries = recoveries(evidence, settings, method, folder=folder)
    if len(entries) == 0:
        return np.zeros(len(rows))
    own = entries.assign(spent_s=numbers(entries, "duration_s")).groupby(ROLLOUT)["spent_s"].sum()
    keys = pd.MultiIndex.from_frame(rows[ROLLOUT])
    return np.asarray(own.reindex(keys, fill_value=0.0).to_numpy(), dtype=np.float64)
