"""Gate D as a whole: the paired gain, and the decision to promote or to return.

Each candidate meets every simple baseline on identical starts. The paired test and its margin
are fixed before the run; the cost criteria must hold together with it. All conditions of one start
are averaged for the gain: the start is the unit of independence. The candidate is the checkpoint of
its first training seed; what further ones say of the method is told and not judged (`trainings`).
Inside the envelope of the card there must be a gain at all.
"""

from gates.claim import CHECKPOINT_ONLY, ONE_OF_SEVERAL
from gates.criterion import Measured, criteria_of, criterion
from gates.engine import Decision, GateSpec, Judged
from gates.evidence import Evidence, MissingEvidenceError
from gates.more import no_decision
from gates.overrides import OVERRIDES
from gates.preregistration import PREREGISTRATION
from gates.stress import cost, safety, trial
from gates.stress.choice import choose
from gates.stress.clocks import clocks_said
from gates.stress.contact import contact_said
from gates.stress.gains import by_condition, in_success, inside_envelope, least_gain
from gates.stress.monitors import monitors_said
from gates.stress.pairs import paired_differences
from gates.stress.planned import planner_said
from gates.stress.rollouts import JOURNALS, REFUSED, StressSettings
from gates.stress.simple import handicaps_said, require_met
from gates.stress.stopped import stopped_by
from gates.stress.stopping import stopped_said
from gates.stress.trainings import trainings_said
from gates.stress.utility import mean_worths
from gates.stress.visited import visited_said
from gates.stress.weights import listed
from gates.words import points
from genpolicy.statistics.possible import GAIN

AVERAGED = (
    "Starts are the unit of independence; conditions and seeds of one start are averaged, and "
    "a gain must be shown inside the envelope too. In another condition it may be lost."
)
OF_ONE_TRAINING = AVERAGED.replace("conditions and seeds", "conditions")


@criterion(
    ">=",
    question="Is the gain over every simple baseline larger than the margin?",
    look_at="The gain does not exceed the margin; keep the simpler policy.",
    per_candidate=True,
    always=True,
    derived=lambda settings: 1.0 / settings.alpha,
)
def promotion_e_value(evidence: Evidence, settings: StressSettings, candidate: str) -> Measured:
    """Lowest evidence, over the baselines, that the gain exceeds the margin (e-value).

    It averages conditions, and a card allows one of them: without a gain that is shown inside the
    envelope there is nothing to promote, whatever is gained elsewhere. A loss that is shown there
    is what is measured; where neither is shown, more starts decide. Of a candidate that was
    stopped, since it could show no gain any more, it is the most that it could have shown.
    """
    if stopped := stopped_by(evidence, settings, candidate, GAIN):
        return stopped
    require_met(evidence, settings)
    differences = {
        baseline: paired_differences(evidence, settings, candidate, baseline)
        for baseline in settings.baselines
    }
    inside = inside_envelope(evidence, settings, candidate)
    least = least_gain(differences, inside, settings)
    text = (
        f"lowest over baselines, against {least.baseline}: mean gain in {settings.measure} "
        f"{points(least.gain)} over {settings.planned_starts} starts, margin "
        f"{points(settings.margin)}; "
        f"{by_condition(evidence, settings, candidate)}"
    )
    if settings.utility:
        text = (
            f"{text}; {in_success(evidence, settings, candidate, least.baseline)}; utility is a "
            f"success less {listed(settings.utility)}"
        )
    text = f"{text}; {inside or 'no condition inside the envelope of a card was planned'}"
    if inside and least.measured is None:
        raise MissingEvidenceError(
            f"a gain is shown over all conditions (e-value {least.e_value:.4g}) and none inside "
            f"the envelope (e-value {inside.e_value:.4g}), which is all that a card allows: {text}"
        )
    return Measured(least.measured, caveat=text, counted=f"{settings.planned_starts} starts")


def best_baseline(evidence: Evidence, settings: StressSettings) -> str:
    """The simple method that is worth most.

    Raises:
        MissingEvidenceError: As `mean_worths`.
    """
    means = mean_worths(evidence, settings)
    return max(means, key=lambda name: means[name])  # of equals the one that is named first


def _decide(judged: Judged) -> Decision:
    """Promote a passing candidate, or either of several, or return to the best baseline."""
    if judged.verdict == "INCONCLUSIVE":
        return Decision(no_decision(judged.answers))
    if judged.verdict == "PASS":
        return choose(judged)
    try:
        return Decision(f"return to {best_baseline(judged.evidence, judged.settings)}")
    except MissingEvidenceError as error:
        return Decision(f"return to the simpler policy ({error})")


def _said(judged: Judged) -> list[str]:
    """Of who was stopped, the planner, what was never touched or visited, clocks, monitors."""
    beside = (planner_said, handicaps_said, contact_said, visited_said, clocks_said, monitors_said)
    return [text for of in (trainings_said, stopped_said, *beside) for text in of(judged)]


def _worded(settings: StressSettings, caveat: str) -> str:
    """What is said of the only training is not said where there are further ones."""
    if not settings.further_seeds:
        return caveat
    return {CHECKPOINT_ONLY: ONE_OF_SEVERAL, AVERAGED: OF_ONE_TRAINING}.get(caveat, caveat)


GATE = GateSpec(
    gate="D",
    settings=StressSettings,
    criteria=criteria_of(vars(trial), vars(cost), vars(safety), globals()),
    bind=(JOURNALS, REFUSED, PREREGISTRATION, OVERRIDES),
    back_to="the simpler policy",
    go_on="Draft the trial card.",
    caveats=(
        CHECKPOINT_ONLY,
        "Simulation: contact, sensing and delays are models; nothing here was seen on hardware.",
        AVERAGED,
        "Every cost and every bound of success holds in each planned condition, not on average; "
        "the share of the fallback not in the drill that calls for it.",
        "Only methods matched in data, encoder, horizons, resets and deadlines are compared, but "
        "for those that are named as unmatched.",
    ),
    below="C",
    decide=_decide,
    said=_said,
    worded=_worded,
)
