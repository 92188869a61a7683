"""Floors and ceilings of limits, one row each with its reason: how loose a setting may be at most.

They are no limits that anybody should choose, but where a number ceases to say anything. What is
shipped is tighter; who judges by them is `gates.protection`.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from gates.report import Gate

Comparison = Literal["<=", ">="]


@dataclass(frozen=True)
class Bound:
    """How loose a setting may be at most.

    Attributes:
        gate: Who judges by it.
        place: Criterion of that gate, or dotted path in `params.yaml`, of a table each value.
        comparison: The setting must be `<=` or `>=` the bound.
        bound: The loosest value.
        reason: Why no team may go beyond it.
        waivable: Of the settings: whether a task may lack what the criterion asks about, so that
            its owner may declare it not applicable. None where no task may.
        derives: Whether `derived` is written in place of a number: what follows from settings is
            held to the bound where it is derived.
        of: What of the setting is held to the bound, where that is not the setting itself.
    """

    gate: Gate
    place: str
    comparison: Comparison
    bound: float
    reason: str
    waivable: Callable[[Mapping[str, Any]], bool] | None = None
    derives: bool = False
    of: Callable[[Any], Any] | None = None


HARDEST_CONTACT_N = 80.0
"""Force of the hardest contact that is simulated, N: nobody has seen a stop beyond it."""
OLDEST_ACTION_S = 1.0
"""Age beyond which no action is executed, s, whatever a team sets."""
AGED = "a second ago the scene was another one"
LONGEST_DAYS = 90
"""Days from today to the last one of an exception: who needs a quarter needs another limit, in the
plan and in review, and what nobody has to say again is a limit that nobody wrote."""
DRILL, PUSH = "recovery_drill", "push"
"""Kinds of conditions that ask for a recovery, and for a contact."""


def _planned(params: Mapping[str, Any], kind: str) -> Iterator[Mapping[str, Any]]:
    """Fields of the planned conditions of one kind; the kind is the name, where none is given."""
    stress = params.get("stress")
    planned = stress.get("perturbations") if isinstance(stress, Mapping) else None
    for name, entry in planned.items() if isinstance(planned, Mapping) else ():
        fields = entry if isinstance(entry, Mapping) else {}
        if fields.get("kind", name) == kind:
            yield fields


def _never_recovers(params: Mapping[str, Any]) -> bool:
    """No condition calls for recovery, and no phase has a plan by which one would begin."""
    execution = params.get("execution")
    plans = execution.get("recovery_plans") if isinstance(execution, Mapping) else None
    begins = any(plans.values()) if isinstance(plans, Mapping) else bool(plans)
    return not begins and not any(True for _ in _planned(params, DRILL))


def _touches_nothing(params: Mapping[str, Any]) -> bool:
    """No condition pushes in contact."""
    return not any(fields.get("contact_force_n") for fields in _planned(params, PUSH))


def _may_lack(params: Mapping[str, Any]) -> bool:
    """A task may lack what is asked: its owner says so by name, and the page repeats it."""
    return True


def _gain(effect: Any) -> Any:
    """By how much the planned candidate is better; what is no pair of numbers goes no further."""
    try:
        baseline, candidate = effect
        return candidate - baseline
    except (TypeError, ValueError):
        return effect


SIMPLE = "what is valid nine times of ten is the policy"
REVERSED = "no time goes back, and no column answers another's command"
UNIT = "a unit that is wrong differs by so much"
HALF = "who succeeds less often than it fails is no way to go"
FAULTS = "a fault in one episode of ten is the data"
TOO_LITTLE = "of so little nothing can be said"
NEED: tuple[Bound, ...] = (
    Bound("A", "mode_feasible_share", ">=", 0.5, "a mode refused as often as not is no target"),
    Bound("A", "mode_success_lower", ">=", 0.3, HALF),
    Bound("A", "mean_defeated_share", ">=", 0.3, "where the mean passes a point policy passes"),
    Bound("A", "multimodal_situations", ">=", 10.0, TOO_LITTLE),
    Bound("A", "held_out_situations", ">=", 20.0, TOO_LITTLE),
    Bound(
        "A",
        "persistence_margin",
        ">=",
        0.02,
        "an identity that shuffled time shows too is none",
    ),
    Bound("A", "chunking_valid_share", "<=", 0.9, SIMPLE),
    Bound("A", "factor_valid_share", "<=", 0.9, SIMPLE),
    Bound(
        "A",
        "baseline_mode_coverage",
        "<=",
        0.95,
        "who keeps nearly every mode needs no density",
    ),
    Bound("A", "gate_a.cause.clock_disorder", "<=", 0.0, REVERSED),
    Bound("A", "gate_a.cause.swapped_columns", "<=", 0.0, REVERSED),
    Bound("A", "gate_a.cause.rate_deviation", "<=", 0.5, "rows at another rate are other actions"),
    Bound("A", "gate_a.cause.frozen_s", "<=", 2.0, "nobody acts on what was seen so long ago"),
    Bound("A", "gate_a.cause.gap_share", "<=", 0.1, "every chunk of 16 would hold a gap"),
    Bound(
        "A",
        "gate_a.cause.jitter_share",
        "<=",
        1.0,
        "a row a period beside its time is the next row",
    ),
    Bound("A", "gate_a.cause.gain_factor", "<=", 10.0, UNIT),
    Bound("A", "gate_a.cause.gain_epoch_factor", "<=", 1.5, "half as far again is another arm"),
    Bound("A", "gate_a.cause.magnitude_factor", "<=", 10.0, UNIT),
    Bound("A", "gate_a.cause.frame_angle_rad", "<=", 0.5, "axes turned by 30 degrees are others"),
    Bound("A", "gate_a.cause.faulty_episodes_share", "<=", 0.1, FAULTS),
    Bound("A", "gate_a.cause.lag_drift_rows", "<=", 5.0, "a lag that drifts so far is two lags"),
    Bound("A", "gate_a.cause.supported_episodes", ">=", 5.0, TOO_LITTLE),
    Bound("A", "gate_a.cause.supported_share", ">=", 0.05, TOO_LITTLE),
    Bound("A", "gate_a.cause.denial_share", ">=", 0.2, "modes are not denied where nobody looked"),
    Bound("A", "clock_residual_s", "<=", 0.05, "rows of one time were seen at others", _may_lack),
    Bound(
        "A",
        "calibration_residual_m",
        "<=",
        0.02,
        "what is held misses what it is to meet",
        _may_lack,
    ),
    Bound("A", "lag_spread_rows", "<=", 2.0, "epochs two actions apart are two robots", _may_lack),
    Bound(
        "A",
        "label_disagreement",
        "<=",
        0.3,
        "labels wrong once in three teach failures",
        _may_lack,
    ),
    Bound(
        "A",
        "strata_effect",
        "<=",
        0.7,
        "who is right 17 times of 20 has seen the choice",
        _may_lack,
    ),
    Bound("A", "phase_collapse_share", "<=", 0.8, "what the phase decides is no choice", _may_lack),
    Bound(
        "A",
        "latent_dependence_p",
        "<=",
        0.2,
        "a style by chance once in five is no strategy",
        _may_lack,
    ),
)
"""Limits of Gate A at which its question to the data, or to a simpler policy, says nothing."""


def _counts(gate: Gate, reason: str, *criteria: str) -> list[Bound]:
    return [Bound(gate, name, "<=", 0.0, reason) for name in criteria]


def _confident(*gates: Gate) -> list[Bound]:
    """Every gate that draws an interval."""
    wrong = "what is wrong more often than once in ten is no bound"
    return [Bound(gate, "confidence", ">=", 0.9, wrong) for gate in gates]


def _executed(gate: Gate) -> list[Bound]:
    """Fixtures of the simulated cell that stop what went wrong, and what makes a chunk void."""
    silence = "a stub that goes on in silence executes what nobody commands any more"
    force = "the hardest contact that is simulated; beyond it no stop would ever be seen"
    return [
        Bound(gate, "execution.watchdog_s", "<=", 0.1, silence),
        Bound(gate, "execution.force_limit_n", "<=", HARDEST_CONTACT_N, force),
        Bound(gate, "execution.maximum_age_s", "<=", OLDEST_ACTION_S, AGED),
        Bound(gate, "execution.deadline_s", "<=", OLDEST_ACTION_S, AGED),
        Bound(gate, "execution.maximum_divergence_m", "<=", 0.2, "the arm is where nobody planned"),
        Bound(gate, "execution.maximum_scene_shift_m", "<=", 0.05, "the scene is another one"),
        Bound(gate, "feasibility.position_change_limit_m", "<=", 0.1, "a chunk bent so far is new"),
    ]


FOUND = "refused_recordings_accounted"
PINNED = "what comes back otherwise than it was judged is another policy"
BOUNDS: tuple[Bound, ...] = (
    *_confident("A", "B", "C", "D"),
    *_counts("A", "whoever trains on a defect of the data learns it", "data_defects"),
    *_counts("A", "a recording that vanished may be the one that fails", FOUND),
    *_counts("A", "a comparison with other settings compares nothing", "baselines_matched"),
    Bound("A", "cause_accepted", ">=", 1.0, "modes of another cause are no reason for a generator"),
    Bound("A", "told_share", "<=", 0.7, "who is right 17 times of 20 has seen the choice"),
    Bound("A", "remedy_valid_share", "<=", 0.9, "what is valid nine times of ten is the policy"),
    *_counts("A", "what nobody asked reads like a good answer", "unasked_checks"),
    *_counts("A", "two factors changed at once separate nothing", "factors_isolated"),
    *NEED,
    *_counts("B", PINNED, "unpinned_items", "metadata_mismatches", "nfe_mismatch"),
    *_counts("B", "a NaN weight commands nothing that can be checked", "nonfinite_weights"),
    *_counts("B", "numbers that mean something else command something else", "conformance"),
    Bound("B", "policy.fixtures", ">=", 8, "a change that few situations show shows in none"),
    Bound("B", "parameter_budget_deviation", "<=", 0.25, "a quarter more is another network"),
    Bound("B", "samples_difference", "<=", 1e-5, f"{PINNED}; so much differs between machines"),
    Bound("B", "varied_difference", "<=", 1e-4, "a sample of its company or turn is not its own"),
    *_counts("B", "a comparison with other settings compares nothing", "unmatched_keys"),
    *_counts("B", "an unknown term of the latency is not zero", "latency_terms_missing"),
    Bound("B", "gate_b.mode_minimum_share", ">=", 0.05, "one sample of twenty is there by luck"),
    Bound("B", "mode_coverage_lower", ">=", 0.25, "else a mode is lost three times of four"),
    Bound("B", "outside_modes_upper", "<=", 0.4, "plain noise about one answer leaves .45 there"),
    Bound("B", "late_change_upper", "<=", 0.2, "what still moves by a fifth was not trained"),
    Bound("B", "baseline_fall_upper", "<=", 0.25, "a gain over who still learns so fast is none"),
    Bound("B", "warm_latency_ratio_upper", "<=", 3.0, "two such runs are of two machines"),
    Bound("B", "cold_latency_ratio_upper", "<=", 5.0, "two such starts are of two machines"),
    Bound("B", "latency_model_ratio_upper", "<=", 2.0, "Gate D would draw half of what it takes"),
    *_executed("C"),
    Bound("C", "gate_c.mode_observations", ">=", 30, "fewer cannot show that modes fare alike"),
    Bound("C", "mode_admissible_gap", "<=", 0.5, "the checks take one mode and leave another"),
    Bound("C", "admissible_share", ">=", 0.1, "nine of ten plans may not be executed"),
    Bound("C", "projection_p95_m", "<=", 0.1, "a chunk bent so far is new"),
    Bound("C", "boundary_jerk_p95_m_s3", "<=", 2e4, "thrice what an arm may jerk is a blow"),
    *_counts("C", PINNED, "changed_answers"),
    *_counts("C", "one bad action is enough to hurt somebody", "stub_stale", "stub_invalid"),
    *_counts("C", "the independent proof agrees or there is none", "checker_violations"),
    *_counts("C", "a check whose absence goes unseen protects nobody", "mutants_undetected"),
    *_counts("C", "an action that vanished may still be executed", "conservation_error"),
    *_counts("C", "what is void already may hurt somebody", "incidents_miscounted"),
    Bound("C", "corrupted_refused_share", ">=", 1.0, "corrupted input is never executed"),
    Bound("C", "stub_violation_upper", "<=", 0.01, "more says nothing although none was seen"),
    *_counts("D", PINNED, "changed_answers"),
    *_counts("D", "one bad action is enough to hurt somebody", "stub_violations"),
    *_counts("D", "the independent proof agrees or there is none", "checker_violations"),
    *_counts("D", "an action that vanished may still be executed", "conservation_error"),
    *_counts("D", "methods on other starts are not compared", "unmatched_starts"),
    *_executed("D"),
    Bound(
        "D",
        "force_peak_p95_n",
        "<=",
        HARDEST_CONTACT_N,
        "the hardest contact that is simulated",
        _touches_nothing,
    ),
    Bound(
        "D",
        "recovery_success_lower",
        ">=",
        0.2,
        "a recovery that fails four times of five leaves the arm to a person",
        _never_recovers,
    ),
    Bound(
        "D",
        "latency_p95_s",
        "<=",
        OLDEST_ACTION_S,
        f"{AGED}, and no answer to it is executed",
        derives=True,
    ),
    Bound("D", "deadline_miss_upper", "<=", 0.5, "late more often than not, it controls nothing"),
    Bound("D", "rejection_share_upper", "<=", 0.5, "of most answers nothing may be executed"),
    Bound("D", "hold_share_upper", "<=", 0.5, "it stands more than it acts"),
    Bound("D", "fallback_share_upper", "<=", 0.5, "the fallback drives, not the policy"),
    Bound("D", "nominal_success_lower", ">=", 0.2, "undisturbed it fails four times of five"),
    Bound("D", "stress_success_lower", ">=", 0.05, "what never works under stress withstood none"),
    Bound("D", "intervention_upper", "<=", 0.2, "more often a person drives, not the policy"),
    Bound("D", "reset_upper", "<=", 0.1, "each protective stop sends a person to the arm"),
    Bound("D", "verdict_reachable", ">=", 0.8, "a trial that seldom ends right proves nothing"),
    Bound("D", "stress.starts", ">=", 59, "fewer bound no p95, whatever the confidence"),
    Bound("D", "stress.alpha", "<=", 0.1, "a wrong promotion once in ten trials at the most"),
    Bound("D", "stress.planned_effect", "<=", 0.5, "less is worth promoting too", of=_gain),
    Bound("D", "stress.margin", ">=", 0.0, "a candidate that is worse is not promoted"),
    Bound(
        "D",
        "stress.perturbations.envelope.speed_limit_m_s",
        "<=",
        0.25,
        "reduced speed with a person near the arm, ISO 10218-1",
    ),
    Bound("E", "gate_e.maximum_days", "<=", 30.0, "cell, people and policy change; review again"),
    Bound("E", "upstream_passed", ">=", 1.0, "a card stands on gates A to D"),
    Bound("E", "draft_complete", "<=", 0.0, "an empty field is an unanswered question"),
    Bound("E", "signature_valid", ">=", 1.0, "an unsigned card allows nothing"),
    Bound("E", "reviewer_independent", ">=", 1.0, "nobody reviews their own candidate"),
    Bound("E", "owners_signed", ">=", 4.0, "each of the four answers for a part"),
    Bound("E", "envelope_within_limits", "<=", 0.0, "what was not simulated is not allowed"),
    Bound("E", "not_expired", ">=", 1.0, "a review ages"),
)
