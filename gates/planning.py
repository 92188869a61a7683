"""What Gate D can decide with the starts that are planned, said before a rollout.

A limit that no result of this size can keep leaves the gate INCONCLUSIVE whatever the rollouts
show, and a gain that is too small to be found leaves it with the simpler policy. Both follow from
`params.yaml` alone, by the same bounds and the same test by which the gate judges afterwards.
"""

import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import scipy

from gates.bounds import counted_interval, draws_for_quantile
from gates.evidence import MissingEvidenceError
from gates.planned_blocks import Saved, saved_by_blocks
from gates.planned_power import Gain, Stated, smallest_gains, stated_effect
from gates.protection import is_rehearsal
from gates.report import stage_of
from gates.settings import Limits, read_limits, read_params, read_settings
from gates.stated import section
from gates.stress.gate import GATE
from gates.stress.rollouts import NOMINAL, StressSettings
from gates.stress.trial import reachable
from gates.stress.weights import listed
from gates.verdicts import judge_criterion, rounded
from genpolicy.contract.planner import PLANNER
from genpolicy.evidence.documents.stress import Power
from genpolicy.evidence.failure_search.settings import search_settings
from genpolicy.evidence.monitors.settings import MonitorsSettings
from genpolicy.evidence.stress.power import power_document
from genpolicy.evidence.stress.settings import StressSettings as StressSection

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
SHARES = 1000
"""True shares are looked for in tenths of a percent."""
TRUE_SHARE_POWER = 0.8
"""In so many trials a policy keeps a limit in every condition, each by itself, by the share that
is told of it."""


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
class Plan:
    """What is planned, and what it can decide.

    Attributes:
        starts: Starts of each method in each condition.
        methods: Candidates and baselines, each run on every start.
        simple: Names of the baselines, each of which a candidate must beat.
        conditions: Names.
        candidates: Names of those that are registered; alpha is shared between them.
        rollouts: Over all methods and conditions: the comparison.
        graded_rollouts: Beside it, of conditions made harder or milder (`stress.severities`).
        further_seeds: Training seeds beside the one that is promoted (`policy.seeds`).
        further_rollouts: The comparison and what is graded beside it once more with each of them,
            by all that are trained here.
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
        block: Starts of a block; None where all starts are one.
        saved: How far candidates run in blocks, by what they are worth; empty likewise.
    """

    starts: int
    methods: int
    simple: tuple[str, ...]
    conditions: tuple[str, ...]
    candidates: tuple[str, ...]
    rollouts: int
    graded_rollouts: int
    further_seeds: int
    further_rollouts: int
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
    block: int | None
    saved: tuple[Saved, ...]

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
    settings = settings.under(replace(limits, rehearsed=is_rehearsal(params)))
    planned = section(params, "stress", StressSection)
    methods = dict.fromkeys([*settings.candidates, *settings.baselines])
    of_condition = len(methods) * settings.planned_starts
    rollouts = of_condition * len(planned.perturbations)
    graded = of_condition * (len(planned.conditions) - len(planned.perturbations))
    trained = [name for name in methods if name != PLANNER and name not in settings.brought]
    again = len(trained) * settings.planned_starts * len(planned.conditions)
    further = len(settings.further_seeds) * again
    probed = len(settings.candidates) * section(params, "monitors", MonitorsSettings).rollouts
    looks = search_settings(params).evaluations * len(planned.perturbations)
    searched = len(settings.candidates) * looks
    asked = limits.number(REACHABLE, otherwise=POWER)
    power = asked if 0.0 < asked <= 1.0 else POWER  # a rehearsal may ask for anything
    table = power_document(
        planned, candidates=len(settings.candidates), root_seed=settings.root_seed
    )
    return Plan(
        starts=settings.planned_starts,
        methods=len(methods),
        simple=settings.baselines,
        conditions=settings.perturbations,
        candidates=settings.candidates,
        rollouts=rollouts,
        graded_rollouts=graded,
        further_seeds=len(settings.further_seeds),
        further_rollouts=further,
        probe_rollouts=probed,
        searched_rollouts=searched,
        longest_s=(rollouts + graded + further + probed + searched) * planned.episode_limit_s,
        measure=settings.measure,
        weighed=listed(settings.utility),
        margin=settings.margin,
        alpha=settings.alpha,
        power=power,
        stated=stated_effect(settings, table, power),
        bounds=tuple(_bounds(settings, limits, table)),
        gains=tuple(smallest_gains(settings, power)),
        block=None if settings.rule is None else settings.rule.block,
        saved=saved_by_blocks(settings),
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
            bound = _counted(item.id, limit, starts, settings.confidence)
            yield _with_a_true_share(bound, limit, settings) if bound.decidable else bound
        elif item.id in (TOUCHED, ANSWERED):
            yield _quantile(item.id, starts, settings.confidence)
        elif item.id == REACHABLE and limit is not None:
            yield _reachable(settings, table, limit)


def _counted(name: str, limit: float, starts: int, confidence: float) -> Bound:
    """Fewest successes or most failures of the planned starts that keep the limit."""
    ends = _ends(starts, confidence)
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


@cache
def _ends(starts: int, confidence: float) -> tuple[tuple[float, float], ...]:
    """Interval of each count of so many starts, from none to all."""
    counts = range(starts + 1)
    return tuple(counted_interval(hits, starts, confidence=confidence) for hits in counts)


def _with_a_true_share(bound: Bound, limit: float, settings: StressSettings) -> Bound:
    """What a policy must be worth to keep a limit in every condition often enough.

    A few more hits by luck in one of many conditions leave the gate open, so that the limit itself
    is no share that a policy could plan with.
    """
    fewer, starts = bound.criterion in FEWER, settings.planned_starts
    disturbed = len([name for name in settings.perturbations if name != NOMINAL])
    # Of recoveries nobody plans the number.
    judged = {MORE[0]: 1, MORE[1]: disturbed, RECOVERY: 0}
    conditions = judged.get(bound.criterion, len(settings.perturbations))
    if not conditions:
        return bound
    hits, ends = np.arange(starts + 1), _ends(starts, settings.confidence)
    kept = [high <= limit if fewer else low >= limit for low, high in ends]
    steps = np.arange(SHARES + 1) / SHARES
    often = np.sum(scipy.stats.binom.pmf(hits[kept][:, None], starts, steps), axis=0) ** conditions
    enough = steps[often >= TRUE_SHARE_POWER]
    worth = float(enough.max() if fewer else enough.min())
    side = "at most" if fewer else "at least"
    says = f"; kept in {TRUE_SHARE_POWER:.0%} of trials by a true share of {side} {worth:.1%}"
    return replace(bound, says=bound.says + says)


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
