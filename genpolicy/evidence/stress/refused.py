"""Chunks that a layer refused, whole: what was drawn, what projection made of it, and why not.

An admitted chunk stands in the journal. Of a refused one the journal states the verdict and the
hashes; the numbers stand in `refused.parquet`, of failures and of the rollouts that are worth a
look, since of all of them they would be most of what the comparison writes.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from genpolicy.contract.chunk import actions_sha256, raw_actions
from genpolicy.evidence.rows.stress import RefusedRow, RolloutRow
from genpolicy.evidence.shadow.candidate_rows import numbers_sha256, touching_of
from genpolicy.evidence.stress.state import InFlight
from genpolicy.evidence.stress.worth import kept_whole
from genpolicy.feasibility.admission import Admitted, FeasibilityChecker, Rejected
from genpolicy.feasibility.context import Context


@dataclass(frozen=True)
class Refused:
    """A candidate that was refused, as long as its rollout goes on.

    Attributes:
        candidate: Its number among the candidates of its invocation.
        result: The chunk and the verdict.
        context: What it was checked against.
    """

    candidate: int
    result: Rejected
    context: Context


def measures_of(flying: InFlight, result: Admitted | Rejected) -> dict[str, Any]:
    """What a journal states of a candidate beside its verdict: arrays by their hash."""
    found = {"drawn_sha256": actions_sha256(raw_actions(flying.drawn))}
    if isinstance(result, Rejected):
        projected = result.projected
        found["raw_sha256"] = numbers_sha256(_numbers(projected.proposal.actions))
        found["projected_sha256"] = numbers_sha256(_numbers(projected.actions))
    return found


def refused_rows(
    rollouts: Sequence[RolloutRow],
    refused: Sequence[Sequence[Refused]],
    checker: FeasibilityChecker,
    *,
    every: bool = False,
) -> list[RefusedRow]:
    """Rows of `refused.parquet`, in the order in which they were judged.

    Args:
        rollouts: Of one method under one condition.
        refused: Of each of them, what was refused.
        checker: Refused it; says which action offends first.
        every: Of every rollout, where only others can say which of them are worth a look.
    """
    kept = [True] * len(rollouts) if every else kept_whole(rollouts)
    return [
        _row(row, one, checker)
        for row, own, whole in zip(rollouts, refused, kept, strict=True)
        for one in (own if whole else ())
    ]


def _row(rollout: RolloutRow, one: Refused, checker: FeasibilityChecker) -> RefusedRow:
    projected = one.result.projected
    verdict = checker.located(projected, one.result.verdict, context=one.context)
    first = verdict.first
    assert first is not None, "a verdict that passed is no rejection"
    touching = touching_of(verdict)
    return RefusedRow(
        method=rollout.method,
        seed=rollout.seed,
        perturbation=rollout.perturbation,
        start=rollout.start,
        chunk_id=projected.metadata.chunk_id,
        candidate=one.candidate,
        layer=str(first.name),
        first_reason=str(verdict.first_reason or ""),
        first_row=first.row,
        layer_margin=first.margin if math.isfinite(first.margin) else None,
        margin_unit=str(first.unit or ""),
        touching=tuple(touching),
        raw=_numbers(projected.proposal.actions),
        projected=_numbers(projected.actions),
    )


def _numbers(actions: Any) -> tuple[float, ...]:
    return tuple(actions.ravel().tolist())
