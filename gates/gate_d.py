"""Gate D, matched simulation and stress: is the gain larger than its cost?

Each candidate meets every simple baseline on identical starts. The paired test and its margin
are fixed before the run; the cost criteria (deadlines, age, fallback, intervention, force) must
hold together with it.
"""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

from pydantic import Field

from gates import gain
from gates.engine import CriterionSpec, GateSpec, judge_gate, standing
from gates.evidence import Evidence, MissingEvidenceError
from gates.gain import NOMINAL, ROLLOUTS, STRESS, best_baseline
from gates.models import Criterion, GateReport, StrictModel, Threshold, Verdict
from genpolicy.errors import ConfigError


class Params(StrictModel):
    """Settings of Gate D other than thresholds; all are fixed before the run.

    Attributes:
        confidence: Coverage of every interval.
        candidates: Methods that stand for promotion.
        baselines: Simpler methods; a candidate must beat each of them.
        perturbations: Conditions that every method must have met; `nominal` is one.
        margin: Gain in success share to be shown.
        alpha: Probability of a wrong promotion, per candidate.
        planned_starts: Starts planned; fewer recorded ones leave the gate without a verdict.
        minimum_power: Share of simulated trials in which each verdict must be reached.
    """

    confidence: float = Field(default=0.95, gt=0.5, lt=1.0)
    candidates: tuple[str, ...]
    baselines: tuple[str, ...] = ("bc", "chunked_bc", "act")
    perturbations: tuple[str, ...]
    margin: float = Field(gt=-1.0, lt=1.0)
    alpha: float = Field(gt=0.0, lt=0.5)
    planned_starts: int = Field(gt=0)
    minimum_power: float = Field(default=0.8, gt=0.0, le=1.0)


def judge(root: Path, thresholds: Mapping[str, Threshold], params: Params) -> GateReport:
    """Report of Gate D from the evidence below `root`; only methods that passed C stand.

    Raises:
        ConfigError: A threshold of no criterion, or one that contradicts the settings.
        IntegrityError: Evidence that is not what it claims to be.
    """
    _check_settings(thresholds, params)
    names, caveats = standing(root, "C", params.candidates)
    evidence = Evidence(root)

    def decision(
        criteria: Sequence[Criterion], verdict: Verdict, verdicts: dict[str, Verdict]
    ) -> str:
        return _decide(evidence, params, criteria, verdict, verdicts)

    return judge_gate(
        SPEC, evidence, thresholds, params, candidates=names, caveats=caveats, decision=decision
    )


def _check_settings(thresholds: Mapping[str, Threshold], params: Params) -> None:
    test = thresholds.get("promotion_e_value")
    needed = 1.0 / params.alpha
    if test is not None and test.limit < needed * (1.0 - 1e-9):
        raise ConfigError(
            where="params.yaml: gate_d.thresholds.promotion_e_value.limit",
            found=f"{test.limit:g}",
            expected=f"at least 1 / alpha = {needed:g}",
            action="Set the limit from alpha; a lower one promotes wrongly too often.",
        )
    if NOMINAL not in params.perturbations or len(params.perturbations) < 2:
        raise ConfigError(
            where="params.yaml: gate_d.perturbations",
            found=", ".join(params.perturbations) or "empty",
            expected=f"{NOMINAL} and at least one more",
            action="List the conditions of the stress stage.",
        )


def _decide(
    evidence: Evidence,
    params: Params,
    criteria: Sequence[Criterion],
    verdict: Verdict,
    verdicts: dict[str, Verdict],
) -> str:
    if verdict == "INCONCLUSIVE":
        return "No decision: complete the evidence, then judge again."
    if verdict == "PASS":
        values = {
            c.candidate: c.measured if c.measured is not None else -math.inf
            for c in criteria
            if c.id == "promotion_e_value" and c.candidate
        }
        passed = sorted(
            (name for name, one in verdicts.items() if one == "PASS"),
            key=lambda name: (-values.get(name, -math.inf), name),
        )
        return f"promote {passed[0]}"
    try:
        return f"return to {best_baseline(evidence, params)}"
    except MissingEvidenceError as error:
        return f"return to the simpler policy ({error})"


SPEC = GateSpec(
    gate="D",
    bind=(f"{STRESS}/journals/*.mcap",),
    back_to="the simpler policy",
    go_on="Draft the trial card.",
    caveats=(
        "Simulation: contact, sensing and delays are models; nothing here was seen on hardware.",
        "Starts are the unit of independence; conditions and seeds of one start are averaged.",
        "Only methods matched in data, encoder, horizons, resets and deadlines are compared.",
    ),
    criteria=(
        CriterionSpec(
            "unmatched_starts",
            "Did all methods begin from identical states?",
            "<=",
            "model",
            (ROLLOUTS,),
            gain.unmatched_starts,
            "Evaluator: starts differ, so the methods cannot be compared; fix the resets.",
            per_candidate=True,
        ),
        CriterionSpec(
            "verdict_reachable",
            "Could the test have come out either way at this size?",
            ">=",
            "model",
            (f"{STRESS}/power.json",),
            gain.verdict_reachable,
            "Evaluator: too few starts for this margin; plan more before looking at results.",
        ),
        CriterionSpec(
            "nominal_success_lower",
            "Does it succeed undisturbed?",
            ">=",
            "model",
            (ROLLOUTS,),
            gain.nominal_success,
            "Generator training: it fails undisturbed; look at samples before stress.",
            per_candidate=True,
        ),
        CriterionSpec(
            "deadline_miss_upper",
            "How often does it miss its deadline?",
            "<=",
            "controller",
            (ROLLOUTS,),
            gain.deadline_miss,
            "Timing: the sampler is too slow for the period; fewer NFE, or prefetch.",
            per_candidate=True,
        ),
        CriterionSpec(
            "action_age_p95_s",
            "How old are the observations behind the actions?",
            "<=",
            "perception",
            (ROLLOUTS,),
            gain.action_age,
            "Timing: look at queue, replacement and camera delay.",
            per_candidate=True,
        ),
        CriterionSpec(
            "fallback_share_upper",
            "What share of time does the fallback drive?",
            "<=",
            "safety",
            (ROLLOUTS,),
            gain.fallback,
            "Timing: the fallback does the work; read discards by reason.",
            per_candidate=True,
        ),
        CriterionSpec(
            "intervention_upper",
            "How often must a person step in?",
            "<=",
            "safety",
            (ROLLOUTS,),
            gain.intervention,
            "Feasibility: recovery ends at a person too often; read recovery by phase.",
            per_candidate=True,
        ),
        CriterionSpec(
            "stub_violations",
            "How many stale or invalid actions reached the stub?",
            "<=",
            "safety",
            (f"{STRESS}/stub.parquet",),
            gain.stub_violations,
            "Feasibility: a stale or rejected action reached the controller; stop here.",
            per_candidate=True,
        ),
        CriterionSpec(
            "force_peak_p95_n",
            "How hard does it touch?",
            "<=",
            "safety",
            (ROLLOUTS,),
            gain.force_peak,
            "Contact controller: look at stale actions and phase transitions, then gains.",
            per_candidate=True,
        ),
        CriterionSpec(
            "stress_success_lower",
            "Does it succeed under the worst perturbation?",
            ">=",
            "model",
            (ROLLOUTS,),
            gain.stress_success,
            "Timing: see which perturbation breaks it, and its ages and discards.",
            per_candidate=True,
        ),
        CriterionSpec(
            "conservation_error",
            "Is every generated action executed, discarded by reason, or queued?",
            "<=",
            "controller",
            (f"{STRESS}/conservation.parquet", f"{STRESS}/counts.parquet"),
            gain.conservation,
            "Evaluator: actions vanish or appear; read the counts per perturbation.",
            per_candidate=True,
        ),
        CriterionSpec(
            "checker_violations",
            "What does the independent checker find in the journals?",
            "<=",
            "safety",
            (f"{STRESS}/checker.json",),
            gain.checker_violations,
            "Evaluator: executor and independent checker disagree; read the violations.",
        ),
        CriterionSpec(
            "promotion_e_value",
            "Is the gain over every simple baseline larger than the margin?",
            ">=",
            "model",
            (ROLLOUTS,),
            gain.promotion,
            "The gain does not exceed the margin; keep the simpler policy.",
            per_candidate=True,
        ),
    ),
)
