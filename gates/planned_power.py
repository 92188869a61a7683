"""Which gain the paired test of Gate D finds with the planned starts, by simulated trials."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from gates.stress.rollouts import StressSettings
from gates.stress.weights import by_cost
from genpolicy.evidence.documents.stress import Power
from genpolicy.evidence.stress.power import POWER_CORRELATION, POWER_TRIALS
from genpolicy.seeds import stream
from genpolicy.statistics.eprocess import Array, paired_e_value, power_table, simulate_pairs

BASELINES = (0.1, 0.3, 0.5, 0.7, 0.9)
STEPS = 100
"""Gains are looked for in points of a hundred."""
CROWDED_TRIALS = 1000
"""Trials against all simple methods at once."""
MOST_STARTS = 1000
"""So many starts are tried for the stated effect, and no more."""


@dataclass(frozen=True)
class Gain:
    """The smallest gain that the paired test finds often enough.

    Attributes:
        baseline_success: Assumed success of the best baseline.
        candidate_success: Success from which a candidate is promoted; None: not even one that
            always succeeds.
        promote_share: How often, of the simulated trials.
    """

    baseline_success: float
    candidate_success: float | None
    promote_share: float


@dataclass(frozen=True)
class Stated:
    """The effect for which the trial is planned, and whether it is found.

    Attributes:
        baseline_success: What the best baseline is worth, as `stress.planned_effect` says.
        candidate_success: What a candidate is that is worth promoting.
        promote_share: How often such a candidate is promoted, of the simulated trials.
        starts_needed: Starts from which it is promoted as often as is asked; None: not with as
            many as are tried.
        dearest_share: How often it is promoted if these are shares of successes, each of which
            costs all that weights take; None where nothing is weighed.
        baselines: Simple methods, each of which a candidate must beat.
        crowded_share: How often it is promoted if every one of them is worth as much as the best.
    """

    baseline_success: float
    candidate_success: float
    promote_share: float
    starts_needed: int | None
    dearest_share: float | None
    baselines: int
    crowded_share: float


def stated_effect(settings: StressSettings, table: Power, power: float) -> Stated:
    """How often the stated effect is found, and with how many starts often enough."""
    baseline, candidate = settings.planned_effect
    shares = {
        (row.baseline_success, row.candidate_success): row.promote_share for row in table.rows
    }
    trials = simulate_pairs(
        baseline,
        candidate,
        correlation=POWER_CORRELATION,
        shape=(POWER_TRIALS, MOST_STARTS),
        rng=stream(settings.root_seed, "plan", "starts"),
    )
    tests = (
        paired_e_value(differences, margin=settings.margin, alpha=settings.alpha)
        for differences in trials
    )
    needed = sorted(test.pairs_needed or MOST_STARTS + 1 for test in tests)
    enough = needed[math.ceil(power * len(needed)) - 1]
    return Stated(
        baseline_success=baseline,
        candidate_success=candidate,
        promote_share=shares[settings.planned_effect],
        starts_needed=enough if enough <= MOST_STARTS else None,
        dearest_share=_dearest(trials, settings),
        baselines=len(settings.baselines),
        crowded_share=_crowded(settings),
    )


def _crowded(settings: StressSettings) -> float:
    """Power where all simple methods are worth as much as the best: the luckiest must be beaten."""
    baseline, candidate = settings.planned_effect
    shape = (CROWDED_TRIALS, settings.planned_starts)
    rng = stream(settings.root_seed, "plan", "crowded")
    own = rng.random(shape)
    promoted = np.ones(CROWDED_TRIALS, dtype=bool)
    for _ in settings.baselines:
        other = np.where(rng.random(shape) < POWER_CORRELATION, own, rng.random(shape))
        gains = (own < candidate).astype(np.float64) - (other < baseline)
        for trial in np.flatnonzero(promoted):
            test = paired_e_value(gains[trial], margin=settings.margin, alpha=settings.alpha)
            promoted[trial] = test.decision == "promote"
    return float(promoted.mean())


def _dearest(trials: Array, settings: StressSettings) -> float | None:
    """Power where every success, of whomever, costs all that the weights can take from it."""
    if not settings.utility:
        return None
    kept = 1.0 - sum(by_cost(settings.utility).values())
    tests = [
        paired_e_value(kept * pairs, margin=settings.margin, alpha=settings.alpha)
        for pairs in trials[:, : settings.planned_starts]
    ]
    return sum(test.decision == "promote" for test in tests) / len(tests)


def smallest_gains(settings: StressSettings, power: float) -> Iterator[Gain]:
    """For some baselines, the candidate that is just found: more success is found more often."""
    for baseline in sorted({*BASELINES, settings.planned_effect[0]}):

        def found(step: int, baseline: float = baseline) -> float:
            (row,) = power_table(
                [(baseline, step / STEPS)],
                margin=settings.margin,
                alpha=settings.alpha,
                pairs=settings.planned_starts,
                correlation=POWER_CORRELATION,
                trials=POWER_TRIALS,
                rng=stream(settings.root_seed, "plan", f"{baseline:g}"),
            )  # the same draws at every step, so that what is found grows with it
            return row.promote_share

        below, above = -1, STEPS
        if not found(above) >= power:
            yield Gain(baseline, None, found(above))
            continue
        while above - below > 1:
            middle = (above + below) // 2
            below, above = (below, middle) if found(middle) >= power else (middle, above)
        yield Gain(baseline, above / STEPS, found(above))
