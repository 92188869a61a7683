"""Who can no longer pass, whatever the rest of the planned rollouts shows.

A candidate is out from the block on behind which no outcome of the rest could still make it pass:
even if it won every start that is left, in every condition, over simple methods that win none. The
verdict on it is the one of all starts, so that no error rate moves. Who does well is never stopped:
costs are bounded by the planned number of starts, and a bound at a number that the outcomes chose
covers nothing.

A pure function of rows: no clock, no score of anybody, no order. The stage asks it to know whom to
run on with, and the gate again to know whom to believe.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from genpolicy.errors import ContractError
from genpolicy.statistics.eprocess import highest_e_value
from genpolicy.statistics.intervals import clopper_pearson
from genpolicy.statistics.planned_blocks import Rule

Array = NDArray[np.float64]

GAIN = "promotion_e_value"
"""Name of the reason that no gain can be shown any more, the criterion that asks for one."""
ROUNDING = 1e-9
"""Share by which evidence must stay below what is asked: the gate may add up in another order."""
STOPPED = ("collision", "force_stop")
"""Outcomes that stay until a person resets the cell."""


class Ended(Protocol):
    """What is asked of a rollout; columns of `RolloutRow`."""

    @property
    def method(self) -> str:
        """The method."""
        ...

    @property
    def perturbation(self) -> str:
        """What was injected."""
        ...

    @property
    def start(self) -> int:
        """Number of the initial state."""
        ...

    @property
    def outcome(self) -> str:
        """How it ended."""
        ...

    @property
    def success(self) -> bool:
        """Whether it succeeded."""
        ...

    @property
    def interventions(self) -> int:
        """Calls for a person."""
        ...


@dataclass(frozen=True)
class Out:
    """Why a candidate can no longer pass.

    Attributes:
        criterion: The criterion that it cannot meet any more.
        value: What that would measure at the planned end, were all of the rest as good as can be.
        limit: What is asked of it at the least.
        said: The same in words.
    """

    criterion: str
    value: float
    limit: float
    said: str


@dataclass(frozen=True)
class Seen:
    """Rollouts of one method as arrays, each of shape (conditions, starts), conditions as planned.

    Attributes:
        success: Whether it succeeded.
        intervention: Whether a person was called.
        reset: Whether it ended in a stop that a person must reset.
    """

    success: NDArray[np.bool_]
    intervention: NDArray[np.bool_]
    reset: NDArray[np.bool_]

    @property
    def starts(self) -> int:
        """Starts that were run in every condition."""
        return int(self.success.shape[1])


def seen_of(rows: Iterable[Ended], rule: Rule) -> dict[str, Seen]:
    """Rollouts under the judged conditions by method, in whatever order they come.

    Raises:
        ContractError: A method has not the same starts, from 0 on and each once, in every planned
            condition.
    """
    by_method: dict[str, dict[tuple[str, int], Ended]] = {}
    for row in rows:
        if row.perturbation not in rule.conditions:
            continue
        own, key = by_method.setdefault(row.method, {}), (row.perturbation, int(row.start))
        if key in own:
            raise _uneven(row.method, f"start {row.start} twice in {row.perturbation}")
        own[key] = row
    return {method: _seen(method, own, rule) for method, own in by_method.items()}


def _seen(method: str, own: Mapping[tuple[str, int], Ended], rule: Rule) -> Seen:
    starts = len(own) // len(rule.conditions)
    wanted = [(name, start) for name in rule.conditions for start in range(starts)]
    if set(own) != set(wanted):
        told = ", ".join(
            f"{sum(key[0] == name for key in own)} in {name}" for name in rule.conditions
        )
        raise _uneven(method, told)
    shape = (len(rule.conditions), starts)
    rows = [own[key] for key in wanted]
    return Seen(
        success=np.array([bool(row.success) for row in rows], dtype=bool).reshape(shape),
        intervention=np.array([row.interventions >= 1 for row in rows], dtype=bool).reshape(shape),
        reset=np.array([row.outcome in STOPPED for row in rows], dtype=bool).reshape(shape),
    )


def _uneven(method: str, found: str) -> ContractError:
    return ContractError(
        where=f"rollouts of {method}",
        found=found,
        expected="the same starts, from 0 on and each once, in every planned condition",
        action="Run the stage `stress` again.",
    )


def out_after(rule: Rule, seen: Mapping[str, Seen], candidate: str, starts: int) -> Out | None:
    """Why a candidate is out once so many starts are run; None where it may still pass.

    Args:
        rule: What is planned.
        seen: By method; of the candidate and of each simple method at least so many starts.
        candidate: Who is asked about.
        starts: How many of them are looked at.

    Raises:
        ContractError: Fewer are there.
    """
    for name in (candidate, *rule.simple):
        if name not in seen or seen[name].starts < starts:
            there = seen[name].starts if name in seen else 0
            raise _uneven(name, f"{there} starts where {candidate} is asked about after {starts}")
    return _no_gain(rule, seen, candidate, starts) or _miscounted(rule, seen[candidate], starts)


def _no_gain(rule: Rule, seen: Mapping[str, Seen], candidate: str, starts: int) -> Out | None:
    own, left = _worth(seen[candidate], starts), rule.starts - starts
    highest, baseline = min(
        (highest_e_value(own - _worth(seen[name], starts), margin=rule.margin, left=left), name)
        for name in rule.simple
    )
    asked = 1.0 / rule.alpha
    if not highest * (1.0 + ROUNDING) < asked:
        return None
    said = (
        f"won it all of the {left} left, the evidence of a gain over {baseline} would reach "
        f"{highest:.3g} to 1, where {asked:.4g} to 1 is needed"
    )
    return Out(GAIN, highest, asked, said)


def _worth(seen: Seen, starts: int) -> Array:
    """Share of the conditions in which each of the first starts succeeded. Shape (starts,)."""
    return np.asarray(seen.success[:, :starts].mean(axis=0), dtype=np.float64)


def _miscounted(rule: Rule, seen: Seen, starts: int) -> Out | None:
    """The first bound of a count that cannot be kept any more, in the condition that breaks it."""
    left = rule.starts - starts
    for bound in rule.counted:
        for condition in bound.conditions:
            hits = int(getattr(seen, bound.what)[rule.conditions.index(condition), :starts].sum())
            good = bound.what == "success"
            most = hits + left if good else hits
            lower, upper = _ends(most, rule.starts, rule.confidence)
            value = lower if good else upper
            if (value < bound.limit) if good else (value > bound.limit):
                kept = f"a lower bound of {value:.3g}" if good else f"an upper bound of {value:.3g}"
                side = "at least" if good else "at most"
                said = (
                    f"{hits} of {starts} in {condition} count for `{bound.criterion}`: were all of "
                    f"the {left} left good, that leaves {kept}, where no limit is looser than "
                    f"{side} {bound.limit:g}"
                )
                return Out(bound.criterion, value, bound.limit, said)
    return None


_ends = cache(clopper_pearson)
"""The same few counts are asked about for each condition, method and block."""


def first_out(rule: Rule, seen: Mapping[str, Seen], candidate: str) -> tuple[int, Out] | None:
    """The block end at which a candidate is out first, of those that all needed have run.

    Args:
        rule: What is planned.
        seen: By method.
        candidate: Who is asked about.

    Returns:
        Starts that it ran to be out, and why; None where it may still pass, or ran to the end.
    """
    there = min(seen[name].starts if name in seen else 0 for name in (candidate, *rule.simple))
    for end in rule.ends[:-1]:
        if end > there:
            return None
        if found := out_after(rule, seen, candidate, end):
            return end, found
    return None


def due(rule: Rule, seen: Mapping[str, Seen], candidates: Sequence[str]) -> dict[str, int]:
    """How many starts each method has to have run.

    A candidate runs until it is out, a simple method as long as any candidate is in.

    Args:
        rule: What is planned.
        seen: By method.
        candidates: Who stands for promotion and was run.
    """
    ends = {name: first_out(rule, seen, name) for name in candidates}
    own = {name: rule.starts if out is None else out[0] for name, out in ends.items()}
    last = max(own.values(), default=rule.starts)
    return {**own, **dict.fromkeys(rule.simple, last)}
