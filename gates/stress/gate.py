"""Gate D as a whole: the paired gain, and the decision to promote or to return.

Each candidate meets every simple baseline on identical starts. The paired test and its margin
are fixed before the run; the cost criteria must hold together with it. All conditions and
training seeds of one start are averaged: the start is the unit of independence.
"""

import math

import numpy as np
import pandas as pd

from gates.claim import CHECKPOINT_ONLY, IN_SHORT
from gates.criterion import Measured, criteria_of, criterion
from gates.engine import Decision, GateSpec, Judged
from gates.evidence import Array, Evidence, MissingEvidenceError, flags
from gates.stress import cost, trial
from gates.stress.rollouts import ROLLOUTS, STRESS, StressSettings, rollouts
from genpolicy.evidence.rows.stress import RolloutRow
from genpolicy.statistics.eprocess import paired_e_value


@criterion(
    ">=",
    question="Is the gain over every simple baseline larger than the margin?",
    look_at="The gain does not exceed the margin; keep the simpler policy.",
    per_candidate=True,
    always=True,
    derived=lambda settings: 1.0 / settings.alpha,
)
def promotion_e_value(evidence: Evidence, settings: StressSettings, candidate: str) -> Measured:
    """Lowest evidence, over the baselines, that the gain exceeds the margin (e-value)."""
    found = []
    for baseline in settings.baselines:
        differences = paired_differences(evidence, settings, candidate, baseline)
        test = paired_e_value(differences, margin=settings.margin, alpha=settings.alpha)
        found.append((float(test.e_value), baseline, float(differences.mean())))
    value, baseline, gain = min(found)
    text = (
        f"lowest over baselines, against {baseline}: mean gain {gain:.4g} over "
        f"{settings.planned_starts} starts, margin {settings.margin:g}"
    )
    return Measured(value, caveat=text)


def paired_differences(
    evidence: Evidence, settings: StressSettings, method: str, baseline: str
) -> Array:
    """Success of `method` minus that of `baseline`, per start. Shape (planned_starts,).

    All conditions and seeds of a start are one draw, so that the pairs are independent.
    """
    own, other = (
        success_by_start(evidence, settings, method),
        success_by_start(evidence, settings, baseline),
    )
    common = own.index.intersection(other.index)[: settings.planned_starts]
    if len(common) < settings.planned_starts:
        raise MissingEvidenceError(f"only {len(common)} starts are shared with {baseline}")
    return np.asarray(own[common].to_numpy() - other[common].to_numpy(), dtype=np.float64)


def success_by_start(
    evidence: Evidence, settings: StressSettings, method: str
) -> "pd.Series[float]":
    """Mean success of a method per start, over conditions and training seeds, in start order."""
    rows = rollouts(evidence, settings, method)
    if rows["success"].isna().any():
        raise MissingEvidenceError(f"{method} has a rollout without outcome")
    rows = rows.assign(success=flags(rows, "success").astype(np.float64))
    means = rows.groupby(["start", "perturbation"])["success"].mean()
    return means.groupby("start").mean().sort_index()


def best_baseline(evidence: Evidence, settings: StressSettings) -> str:
    """The simple method with the highest success over all planned conditions.

    Raises:
        MissingEvidenceError: A baseline was not run.
    """
    means: dict[str, float] = {}
    for method in settings.baselines:
        rows = evidence.of(ROLLOUTS, RolloutRow, method)
        rows = rows[rows["perturbation"].isin(settings.perturbations)]
        means[method] = float(np.mean(flags(rows, "success"))) if len(rows) else 0.0
    order = list(means)
    return min(order, key=lambda name: (-means[name], order.index(name)))


def _decide(judged: Judged) -> Decision:
    """Promote the passing candidate with the most evidence, or return to the best baseline."""
    if judged.verdict == "INCONCLUSIVE":
        return Decision("No decision: complete the evidence, then judge again.")
    if judged.verdict == "PASS":
        values = {
            answer.candidate: answer.measured if answer.measured is not None else -math.inf
            for answer in judged.answers
            if answer.id == promotion_e_value.id and answer.candidate
        }
        passed = sorted(
            (name for name, one in judged.candidates.items() if one == "PASS"),
            key=lambda name: (-values.get(name, -math.inf), name),
        )
        return Decision(f"promote {passed[0]}, {IN_SHORT}", promoted=passed[0])
    try:
        return Decision(f"return to {best_baseline(judged.evidence, judged.settings)}")
    except MissingEvidenceError as error:
        return Decision(f"return to the simpler policy ({error})")


GATE = GateSpec(
    gate="D",
    settings=StressSettings,
    criteria=criteria_of(vars(trial), vars(cost), globals()),
    bind=(f"{STRESS}/journals/*.mcap",),
    back_to="the simpler policy",
    go_on="Draft the trial card.",
    caveats=(
        CHECKPOINT_ONLY,
        "Simulation: contact, sensing and delays are models; nothing here was seen on hardware.",
        "Starts are the unit of independence; conditions and seeds of one start are averaged.",
        "Only methods matched in data, encoder, horizons, resets and deadlines are compared.",
    ),
    below="C",
    decide=_decide,
)
