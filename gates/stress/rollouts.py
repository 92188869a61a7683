"""Rollouts of the matched comparison, and the settings of Gate D that say which must be there."""

from collections.abc import Callable, Mapping, Sequence
from typing import Annotated, Any, ClassVar, Self

import pandas as pd
from pydantic import AfterValidator, BeforeValidator, Field, field_validator, model_validator

from gates.again import CHANGED
from gates.bounds import share_interval
from gates.criterion import Measured
from gates.evidence import Evidence, MissingEvidenceError
from gates.recount import Subset, Term, is_one, part_said, part_share
from gates.report import Owner, Recount
from gates.settings import CandidateSettings
from gates.stress.itself import require_itself
from gates.stress.stopped import starts_of
from gates.stress.weights import Weights, explained, require_weights
from gates.words import percent
from genpolicy.contract.planner import PLANNER
from genpolicy.evidence.rows.stress import SEVERITIES, RolloutRow
from genpolicy.statistics.planned_blocks import UNWEIGHED, Rule, planned_rule

STRESS = "artifacts/stress"
ROLLED = "rollouts.parquet"
ROLLOUTS = f"{STRESS}/{ROLLED}"
JOURNALS = f"{STRESS}/journals/*.mcap"
REFUSED = f"{STRESS}/refused.parquet"
INVOCATIONS = f"{STRESS}/invocations.parquet"
FAULTS = f"{STRESS}/faults.parquet"
"""Missing where no policy in a process of its own was compared."""
CURVES = f"{STRESS}/{SEVERITIES}"
"""Missing where success is shown against no severity."""
NOMINAL = "nominal"
DRILL = "recovery_drill"
"""Condition in which recovery is called for on every start, so that it is exercised."""
ENVELOPE = "envelope"
"""The one condition inside the workspace and the speed of the trial card, which allows no other."""

UNPLANNED = (
    f"No classical planner was compared: `stress.baselines` does not name {PLANNER}, as where a "
    "task offers none, or in a rehearsal. Whether a scripted plan from the same observations does "
    "as well as a candidate is not known."
)
"""Said where no planner stands among the simple methods."""


Interval = tuple[float, float, float]
"""Share or quantile, lower and upper end."""
SUCCEEDED = is_one("success", True)
"""Of a rollout."""


def _block_of(value: Any) -> Any:
    """What the section `stress` says of blocks, which it may leave out."""
    return value.get("block") if isinstance(value, Mapping) else value


def _unset(value: object) -> bool:
    return value is None


def _of_one_training(seeds: tuple[int, ...]) -> bool:
    return len(seeds) < 2


class StressSettings(CandidateSettings):
    """Settings of Gate D other than limits; all are fixed before the run.

    Attributes:
        baselines: Simpler methods; a candidate must beat each of them.
        perturbations: Conditions that every method must have met; `nominal` is one.
        margin: Gain to be shown, in what is compared (`measure`).
        family_alpha: Probability of any wrong promotion.
        planned_starts: Starts planned; fewer recorded ones leave the gate without a verdict.
        block: Starts after which candidates that can no longer pass are stopped; None, or not below
            `planned_starts`: all run all. Left out of a report where it is not planned.
        planned_effect: What baseline and candidate are worth, success or utility, that the test
            must be able to tell apart.
        episode_limit_s: Longest rollout, s.
        execution_horizon: Actions of a chunk that may be executed.
        action_period_s: Period of the actions, s.
        maximum_age_s: Oldest action that may be executed, s; by phase where phases differ.
        unmatched: Candidates that are compared by exception; none is ranked among the others.
        tolerances: By owner: what the two clocks may differ by, and why; nothing is judged by it.
        monitor_costs: By owner: what a cell of the monitors' cost matrix costs, and why; likewise.
        utility: By owner: what a success loses by a cost, and why; without any success is compared.
        seeds: Numbers of the training seeds; the first is the one that is promoted. Left out of a
            report where there is one.
    """

    homes: ClassVar[Mapping[str, str]] = {
        **CandidateSettings.homes,
        "baselines": "stress.baselines",
        "perturbations": "stress.perturbations",
        "margin": "stress.margin",
        "family_alpha": "stress.alpha",
        "planned_starts": "stress.starts",
        "block": "stress",
        "planned_effect": "stress.planned_effect",
        "episode_limit_s": "stress.episode_limit_s",
        "execution_horizon": "horizons.execution_horizon",
        "action_period_s": "horizons.action_period_s",
        "maximum_age_s": "execution.maximum_age_s",
        "unmatched": "gate_b.unmatched",
        "seeds": "policy.seeds",
    }
    whole: ClassVar[frozenset[str]] = frozenset({"maximum_age_s", "block"})

    candidates: tuple[str, ...] = Field(min_length=1)
    baselines: tuple[str, ...] = Field(min_length=1)
    perturbations: tuple[str, ...]
    margin: float = Field(gt=-1.0, lt=1.0)
    family_alpha: float = Field(gt=0.0, lt=1.0)
    planned_starts: int = Field(gt=0)
    block: Annotated[int | None, BeforeValidator(_block_of)] = Field(
        default=None, ge=1, exclude_if=_unset
    )
    planned_effect: tuple[float, float]
    episode_limit_s: float = Field(gt=0.0)
    execution_horizon: int = Field(gt=0)
    action_period_s: float = Field(gt=0.0)
    maximum_age_s: float | dict[str, float]
    unmatched: tuple[str, ...] = ()
    tolerances: dict[Owner, dict[str, tuple[float, str]]] = Field(default_factory=dict)
    monitor_costs: dict[Owner, dict[str, tuple[float, str]]] = Field(default_factory=dict)
    utility: Annotated[Weights, AfterValidator(require_weights)] = Field(default_factory=dict)
    seeds: tuple[int, ...] = Field(default=(), exclude_if=_of_one_training)

    def tolerance(self, name: str) -> float | None:
        """What the clocks may differ by in one respect; None where nobody has said."""
        return next((of[name][0] for of in self.tolerances.values() if name in of), None)

    def monitor_cost(self, name: str) -> float | None:
        """What a cell of the monitors' cost matrix costs; None where nobody has said."""
        return next((of[name][0] for of in self.monitor_costs.values() if name in of), None)

    def excepted(self, criterion: str, candidate: str | None) -> bool:
        """Whether a criterion is asked of those that were brought only, and this one was not."""
        return criterion == CHANGED and candidate not in self.brought

    @property
    def caveats(self) -> tuple[str, ...]:
        """What is compared, if not success; who is not; whose gain may be one of its training."""
        weighed = (explained(self.utility, self.longest_s),) if self.utility else ()
        unplanned = () if PLANNER in self.baselines else (UNPLANNED,)
        return (
            weighed
            + unplanned
            + tuple(
                f"{name} is unmatched evidence: a gain of it may be one of other data or a longer "
                "training. It is ranked with nobody."
                for name in sorted(self.unmatched)
            )
        )

    @property
    def further_seeds(self) -> tuple[int, ...]:
        """Training seeds beside the one that is promoted."""
        return self.seeds[1:]

    @property
    def measure(self) -> str:
        """What is compared: `success`, or `utility` where costs are weighed."""
        return "utility" if self.utility else "success"

    @property
    def longest_s(self) -> float:
        """How long a rollout can be, s: whole periods, as the comparison counts them."""
        return round(self.episode_limit_s / self.action_period_s) * self.action_period_s

    @property
    def usable_s(self) -> float:
        """How long after its observation a chunk still has an action to execute, s."""
        return self.execution_horizon * self.action_period_s

    @property
    def oldest_s(self) -> float:
        """Oldest action that any phase executes, s."""
        ages = self.maximum_age_s
        return max(ages.values()) if isinstance(ages, dict) else ages

    @property
    def alpha(self) -> float:
        """Probability of a wrong promotion of one candidate (Bonferroni over the candidates)."""
        return self.family_alpha / len(self.candidates)

    @model_validator(mode="after")
    def _success_alone_in_blocks(self) -> Self:
        if self.utility and self.rule is not None:
            raise ValueError(f"stress.block wants {UNWEIGHED}")
        return self

    @property
    def rule(self) -> Rule | None:
        """By what a candidate is stopped; None where all starts are one block."""
        return planned_rule(
            starts=self.planned_starts,
            block=self.block,
            conditions=self.perturbations,
            simple=self.baselines,
            margin=self.margin,
            alpha=self.alpha,
            rehearsal=self.limits.rehearsed,
        )

    @field_validator("perturbations")
    @classmethod
    def _undisturbed_and_more(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        if NOMINAL not in names or len(names) < 2:
            raise ValueError(f"{NOMINAL} and at least one more condition are needed")
        return names


def rollouts(
    evidence: Evidence, settings: StressSettings, method: str, *, folder: str = STRESS
) -> pd.DataFrame:
    """Rollouts of a method under the planned conditions; do not write into the frame.

    Args:
        evidence: Of the comparison.
        settings: Say which conditions and how many starts.
        method: The method.
        folder: Where its rollouts lie; those of another training seed lie in another one.

    Raises:
        StoppedError: It is a candidate that was stopped, since it could no longer pass.
        MissingEvidenceError: A condition is missing, has fewer starts than planned, or the row of a
            rollout does not agree with itself (`require_itself`).
    """
    # Most measures of the gate ask for them, each for every method.
    path = f"{folder}/{ROLLED}"
    key = (path, method, settings.perturbations, settings.planned_starts, settings.block)
    return evidence.once(key, lambda: _rollouts(evidence, settings, method, path))


def _rollouts(evidence: Evidence, settings: StressSettings, method: str, path: str) -> pd.DataFrame:
    rows = evidence.of(path, RolloutRow, method)
    rows = rows[rows["perturbation"].isin(settings.perturbations)]
    absent = sorted(set(settings.perturbations) - set(rows["perturbation"]))
    if absent:
        raise MissingEvidenceError(f"{method} did not meet {', '.join(absent)}")
    planned = starts_of(evidence, settings, method)
    per_condition = rows.groupby("perturbation")["start"].nunique()
    if int(per_condition.min()) < planned:
        raise MissingEvidenceError(
            f"{method} has {int(per_condition.min())} starts in {per_condition.idxmin()}, "
            f"planned {planned}"
        )
    require_itself(rows, method)
    return rows


def within(table: str, condition: str, *terms: Term) -> Subset:
    """Rows of one condition, of which more may have to hold."""
    return Subset(table, (is_one("perturbation", condition), *terms))


def in_every_condition(
    rows: pd.DataFrame,
    of: Subset,
    conditions: Sequence[str],
    measure: Callable[[pd.DataFrame, Subset, str], tuple[Interval, Recount]],
    said: Callable[[float], str],
) -> Measured:
    """An upper bound that must hold in each of some conditions: that of the worst one.

    A policy that breaks the limit in some condition passes that condition with at most the error
    of one bound, so the bounds need no correction for their number (intersection-union).

    Args:
        rows: Rollouts, or invocations, of one method.
        of: Their table, and which of them count in any condition.
        conditions: Where it must hold.
        measure: Point and ends of the interval in one condition, and what they are counted from;
            given its rows, by what they were taken, and its name.
        said: Such a number as a reader reads it.
    """
    found = []
    for condition in conditions:
        subset = within(of.table, condition, *of.terms)
        part = subset.of(rows)
        (point, lower, upper), recount = measure(part, subset, condition)
        found.append((upper, lower, point, condition, part["start"].nunique(), recount))
    upper, lower, point, condition, starts, recount = max(found, key=lambda one: one[:4])
    others = ", ".join(f"{one[3]} {said(one[0])}" for one in found if one[3] != condition)
    text = f"worst in {condition}: {_counted(point, recount, said)}, at most {said(upper)}"
    text += f"; at most in the others: {others}" if others else ""
    counted = f"{starts} starts"
    return Measured(upper, (lower, upper), text, counted=counted, recount=recount, point=point)


def _counted(point: float, recount: Recount, said: Callable[[float], str]) -> str:
    if recount.part is None:
        return said(point)
    units = recount.of.replace("_", " ") or "rollouts"
    return part_said(recount, units)


def success_lower(
    evidence: Evidence, settings: StressSettings, candidate: str, conditions: Sequence[str]
) -> Measured:
    """Lowest lower bound of success over some conditions; the starts are independent.

    Raises:
        MissingEvidenceError: As `rollouts`.
    """
    rows = rollouts(evidence, settings, candidate)
    found = []
    for condition in conditions:
        subset = within(ROLLOUTS, condition)
        part = subset.of(rows)
        _, lower, upper = share_interval(
            SUCCEEDED.holds(part),
            part["start"].to_numpy(),
            confidence=settings.confidence,
            favourable=True,
        )
        recount = subset.counted(part, SUCCEEDED)
        found.append((lower, upper, condition, part["start"].nunique(), recount))
    lower, upper, condition, starts, recount = min(found, key=lambda one: one[:3])
    share = part_said(recount, "rollouts")
    text = f"{condition}: {share} succeed; at least {percent(lower)}, by {starts} starts"
    counted = f"{starts} starts"
    return Measured(
        lower,
        (lower, upper),
        text,
        counted=counted,
        recount=recount,
        point=part_share(recount),
    )
