"""Gate D as a whole: the paired gain, and the decision to promote or to return.

Each candidate meets every simple baseline on identical starts. The paired test and its margin
are fixed before the run; the cost criteria must hold together with it. All conditions and
training seeds of one start are averaged for the gain: the start is the unit of independence.
"""

import numpy as np

from gates.claim import CHECKPOINT_ONLY
from gates.criterion import Measured, criteria_of, criterion
from gates.engine import Decision, GateSpec, Judged
from gates.evidence import Evidence, MissingEvidenceError, flags
from gates.preregistration import PREREGISTRATION
from gates.stress import cost, safety, trial
from gates.stress.choice import choose
from gates.stress.clocks import clocks_said
from gates.stress.pairs import paired_differences
from gates.stress.rollouts import JOURNALS, StressSettings, rollouts
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
    return Measured(value, caveat=text, counted=f"{settings.planned_starts} starts")


def best_baseline(evidence: Evidence, settings: StressSettings) -> str:
    """The simple method with the highest success over all planned conditions.

    Raises:
        MissingEvidenceError: A baseline was not run under every condition, as often as planned.
    """
    means = {
        method: float(np.mean(flags(rollouts(evidence, settings, method), "success")))
        for method in settings.baselines
    }
    return max(means, key=lambda name: means[name])  # of equals the one that is named first


def _decide(judged: Judged) -> Decision:
    """Promote a passing candidate, or either of several, or return to the best baseline."""
    if judged.verdict == "INCONCLUSIVE":
        return Decision("No decision: complete the evidence, then judge again.")
    if judged.verdict == "PASS":
        return choose(judged)
    try:
        return Decision(f"return to {best_baseline(judged.evidence, judged.settings)}")
    except MissingEvidenceError as error:
        return Decision(f"return to the simpler policy ({error})")


GATE = GateSpec(
    gate="D",
    settings=StressSettings,
    criteria=criteria_of(vars(trial), vars(cost), vars(safety), globals()),
    bind=(JOURNALS, PREREGISTRATION),
    back_to="the simpler policy",
    go_on="Draft the trial card.",
    caveats=(
        CHECKPOINT_ONLY,
        "Simulation: contact, sensing and delays are models; nothing here was seen on hardware.",
        "Starts are the unit of independence; conditions and seeds of one start are averaged.",
        "Every cost and every bound of success holds in each planned condition, not on average.",
        "Only methods matched in data, encoder, horizons, resets and deadlines are compared, but "
        "for those that are named as unmatched.",
    ),
    below="C",
    decide=_decide,
    said=clocks_said,
)
