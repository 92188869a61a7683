"""What Gate D can decide with the starts that are planned, said before a rollout.

A limit that no result of this size can keep leaves the gate INCONCLUSIVE whatever the rollouts
show, and a gain that is too small to be found leaves it with the simpler policy. Both follow from
`params.yaml` alone, by the same bounds and the same test by which the gate judges afterwards.
"""

import dataclasses
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gates.bounds import counted_interval, draws_for_quantile
from gates.evidence import MissingEvidenceError
from gates.report import stage_of
from gates.settings import Limits, read_limits, read_params, read_settings
from gates.stated import section
from gates.stress.gate import GATE
from gates.stress.rollouts import StressSettings
from gates.stress.trial import reachable
from gates.stress.weights import by_cost, listed
from gates.verdicts import judge_criterion, rounded
from genpolicy.evidence.documents.stress import Power
from genpolicy.evidence.failure_search.settings import search_settings
from genpolicy.evidence.monitors.settings import MonitorsSettings
from genpolicy.evidence.stress.settings import StressSettings as StressSection
from genpolicy.evidence.stress.tables import POWER_CORRELATION, POWER_TRIALS, power_document
from genpolicy.seeds import stream
from genpolicy.statistics.eprocess import Array, paired_e_value, power_table, simulate_pairs

FEWER = ("intervention_upper", "reset_upper")
"""Criteria of which a rollout is hit or not, and hits are bad: bounded from above."""
MORE = ("nominal_success_lower", "stress_success_lower")
"""The same, and hits are good: bounded from below."""
RECOVERY = "recovery_success_lower"
TOUCHED, ANSWERED = "force_peak_p95_n", "latency_p95_s"
QUANTILE = 0.95
REACHABLE = "verdict_reachable"
POWER = 0.8
"""Power of the smallest gain, where `verdict_reachable` has no limit of its own."""
BASELINES = (0.1, 0.3, 0.5, 0.7, 0.9)
STEPS = 100
"""Gains are looked for in points of a hundred."""
MOST_STARTS = 1000
"""So many starts are tried for the stated effect, and no more."""


@dataclass(frozen=True)
class Bound:
    """What the planned starts can show of one criterion.

    Attributes:
        criterion: Its name.
        decidable: Whether some result keeps the limit; None where that cannot be said before.
        says: Which results do, or why none does.
        fails: Whether the gate is a FAIL whatever is run: a test that promotes without a gain.
    """

    criterion: str
    decidable: bool | None
    says: str
    fails: bool = False


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
    """

    baseline_success: float
    candidate_success: float
    promote_share: float
    starts_needed: int | None
    dearest_share: float | None


@dataclass(frozen=True)
class Plan:
    """What is planned, and what it can decide.

    Attributes:
        starts: Starts of each method in each condition.
        methods: Candidates and baselines, each run on every start.
        conditions: Names.
        candidates: Names of those that are registered; alpha is shared between them.
        rollouts: Over all methods and conditions: the comparison.
        graded_rollouts: Beside it, of conditions made harder or milder (`stress.severities`).
        probe_rollouts: After it, under probes and without, for the stage `monitors`,
            if every registered candidate is admitted.
        searched_rollouts: Behind the gate, where failures of who passed are searched for, if every
            registered candidate passes (`card.failure_search`).
        longest_s: Virtual time if each of all these rollouts took its limit, s.
        measure: What is compared: success, or utility where costs are weighed.
        weighed: Costs and weights; empty where success is compared.
        margin: Gain to be shown, in what is compared.
        alpha: Chance of a wrong promotion of one candidate.
        power: Share of trials in which a gain is to be found.
        stated: The effect that the plan is for.
        bounds: By criterion, in the order of the gate.
        gains: By assumed baseline.
    """

    starts: int
    methods: int
    conditions: tuple[str, ...]
    candidates: tuple[str, ...]
    rollouts: int
    graded_rollouts: int
    probe_rollouts: int
    searched_rollouts: int
    longest_s: float
    measure: str
    weighed: str
    margin: float
    alpha: float
    power: float
    stated: Stated
    bounds: tuple[Bound, ...]
    gains: tuple[Gain, ...]

    @property
    def undecidable(self) -> tuple[str, ...]:
        """Criteria that no result of this plan can meet."""
        return tuple(bound.criterion for bound in self.bounds if bound.decidable is False)

    @property
    def failing(self) -> tuple[str, ...]:
        """Those of them that fail whatever is run; the others can only not be shown."""
        return tuple(bound.criterion for bound in self.bounds if bound.fails)

    def as_document(self) -> dict[str, Any]:
        """For JSON."""
        return {**dataclasses.asdict(self), "undecidable": self.undecidable}


def plan_of(root: Path) -> Plan:
    """What `params.yaml` below `root` plans, and what that can decide.

    Raises:
        ConfigError: A section is missing or wrong.
    """
    params = read_params(root)
    settings = read_settings(params, stage_of("D"), StressSettings)
    limits = read_limits(params, "D", GATE.criteria)
    settings = settings.under(limits)
    planned = section(params, "stress", StressSection)
    methods = dict.fromkeys([*settings.candidates, *settings.baselines])
    of_condition = len(methods) * settings.planned_starts
    rollouts = of_condition * len(planned.perturbations)
    graded = of_condition * (len(planned.conditions) - len(planned.perturbations))
    probed = len(settings.candidates) * section(params, "monitors", MonitorsSettings).rollouts
    looks = search_settings(params).evaluations * len(planned.perturbations)
    searched = len(settings.candidates) * looks
    power = limits.number(REACHABLE, otherwise=POWER)
    table = power_document(
        planned, candidates=len(settings.candidates), root_seed=settings.root_seed
    )
    return Plan(
        starts=settings.planned_starts,
        methods=len(methods),
        conditions=settings.perturbations,
        candidates=settings.candidates,
        rollouts=rollouts,
        graded_rollouts=graded,
        probe_rollouts=probed,
        searched_rollouts=searched,
        longest_s=(rollouts + graded + probed + searched) * planned.episode_limit_s,
        measure=settings.measure,
        weighed=listed(settings.utility),
        margin=settings.margin,
        alpha=settings.alpha,
        power=power,
        stated=_stated(settings, table, power),
        bounds=tuple(_bounds(settings, limits, table)),
        gains=tuple(_gains(settings, power)),
    )


def _bounds(settings: StressSettings, limits: Limits, table: Power) -> Iterator[Bound]:
    starts = settings.planned_starts
    for item in GATE.criteria:
        if item.id in limits.waived:
            yield Bound(item.id, None, "declared not applicable")
            continue
        entry = limits.of.get(item.id)
        limit = entry.limit if entry else None
        if item.id in (*FEWER, *MORE, RECOVERY) and limit is not None:
            yield _counted(item.id, limit, starts, settings.confidence)
        elif item.id in (TOUCHED, ANSWERED):
            yield _quantile(item.id, starts, settings.confidence)
        elif item.id == REACHABLE and limit is not None:
            yield _reachable(settings, table, limit)


def _counted(name: str, limit: float, starts: int, confidence: float) -> Bound:
    """Fewest successes or most failures of the planned starts that keep the limit."""
    ends = [counted_interval(hits, starts, confidence=confidence) for hits in range(starts + 1)]
    if name in FEWER:
        most = max((hits for hits, (_, high) in enumerate(ends) if high <= limit), default=None)
        none = f"none of {starts} bounds it by {ends[0][1]:.3g} only"
        kept = f"up to {most} of {starts}, in each condition"
        return Bound(name, most is not None, none if most is None else kept)
    fewest = min((hits for hits, (low, _) in enumerate(ends) if low >= limit), default=None)
    what = "recoveries" if name == RECOVERY else "successes"
    none = f"{starts} of {starts} {what} show {ends[-1][0]:.3g} only"
    kept = f"from {fewest} {what} of {starts} on"
    return Bound(name, fewest is not None, none if fewest is None else kept)


def _quantile(name: str, starts: int, confidence: float) -> Bound:
    """Whether so many starts bound a p95; many answers of one start may, if they differ."""
    fewest = draws_for_quantile(QUANTILE, confidence)
    if starts >= fewest:
        touched = f"if {fewest} starts or more see contact" if name == TOUCHED else ""
        return Bound(name, True, touched or f"{starts} starts bound a p95 ({fewest} do)")
    if name == TOUCHED:
        return Bound(name, False, f"{starts} starts bound no p95, {fewest} do")
    return Bound(name, None, f"{starts} starts bound a p95 only if answers of one start differ")


def _reachable(settings: StressSettings, table: Power, limit: float) -> Bound:
    """What the gate will say of its own power: the same function says it."""
    try:
        found = reachable(table, settings)
    except MissingEvidenceError as error:
        return Bound(REACHABLE, False, str(error))
    assert found.value is not None, "a share of trials is a number"
    verdict = judge_criterion(rounded(found.value), limit, ">=")
    return Bound(REACHABLE, verdict == "PASS", found.caveat, fails=verdict == "FAIL")


def _stated(settings: StressSettings, table: Power, power: float) -> Stated:
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
    )


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


def _gains(settings: StressSettings, power: float) -> Iterator[Gain]:
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
