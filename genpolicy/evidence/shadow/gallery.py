"""Examples of what was rejected on held-out observations: chosen by a rule, judged once more.

Of each method the most frequent reasons, of each reason the candidate in the middle: of those that
were rejected for it, ordered by margin, the one with as many before it as behind it. Nobody picks.
Each example is judged again from its observation and its raw actions, so that the picture shows
what the layers say of it, and whoever derives it again needs nothing but table and dataset.
"""

from collections import Counter
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.action import ACTION_DIM, POSITION
from genpolicy.contract.chunk import Projected
from genpolicy.errors import IntegrityError
from genpolicy.evidence.documents.gallery import Gallery, RejectedExample
from genpolicy.evidence.rows.shadow import CandidateRow
from genpolicy.evidence.shadow.candidate_rows import touching_of
from genpolicy.evidence.shadow.drawn_bodies import drawn_robot, drawn_scene
from genpolicy.evidence.shadow.observations import Observation
from genpolicy.evidence.shadow.shadow import HELD_OUT, Shadow, admit, case_of
from genpolicy.feasibility.cell import Cell
from genpolicy.feasibility.checks import CHECKS
from genpolicy.feasibility.context import Context
from genpolicy.feasibility.reasons import Reason, Unit
from genpolicy.feasibility.verdict import LayerVerdict

Array = NDArray[np.float64]

REASONS_EACH = 6
"""Reasons of a method that are shown, at most."""
NOT_DRAWN = (Reason.SHAPE,)
"""What is no chunk has no path."""


def chosen(rows: Sequence[CandidateRow]) -> list[tuple[CandidateRow, int, int]]:
    """The examples that the rule takes.

    Returns:
        Row, how many of its method were rejected for its reason, and how many there are.
    """
    held = [row for row in rows if row.fixture == HELD_OUT]
    total = Counter(row.method for row in held)
    order = list(Reason)
    found = []
    for method in sorted(total):
        own = [row for row in held if row.method == method and row.first_reason]
        counts = Counter(Reason(row.first_reason) for row in own)
        often = sorted(set(counts) - set(NOT_DRAWN), key=lambda r: (-counts[r], order.index(r)))
        for reason in often[:REASONS_EACH]:
            alike = sorted((row for row in own if row.first_reason == reason), key=_by_margin)
            found.append((alike[(len(alike) - 1) // 2], counts[reason], total[method]))
    return found


def _by_margin(row: CandidateRow) -> tuple[float, int, int]:
    margin = np.inf if row.layer_margin is None else row.layer_margin
    return float(margin), row.observation, row.candidate


def gallery_of(
    shadow: Shadow, observations: Sequence[Observation], rows: Sequence[CandidateRow]
) -> Gallery:
    """The gallery of a table of candidates.

    Args:
        shadow: What every shadow test shares.
        observations: The held-out moments, in the order of their numbers.
        rows: The table.

    Raises:
        IntegrityError: A row is of no observation, or the layers say something else of it now.
    """
    cell = shadow.checker.cell
    return Gallery(
        workspace_m=[list(cell.workspace.lower_m), list(cell.workspace.upper_m)],
        action_period_s=cell.action_period_s,
        examples=[_example(shadow, observations, *found) for found in chosen(rows)],
    )


def _example(
    shadow: Shadow, observations: Sequence[Observation], row: CandidateRow, alike: int, total: int
) -> RejectedExample:
    where = f"candidate {row.method}/{row.fixture}/{row.observation}/{row.candidate}"
    if not row.observation < len(observations):
        raise _another(where, f"of observation {row.observation}", f"one of {len(observations)}")
    item = observations[row.observation]
    raw = np.array(row.raw, dtype=np.float64).reshape(-1, ACTION_DIM)
    case = case_of(shadow, item, raw, number=row.observation, candidate=row.candidate)
    result, cell = admit(shadow, case), shadow.checker.cell
    projected = result.projected
    verdict = shadow.checker.located(projected, result.verdict, context=case.context)
    told = verdict.first
    if told is None or told.reason is None or told.check is None:
        raise _another(where, f"rejected for {row.first_reason}", "what the layers say: admitted")
    if (told.reason, told.row) != (row.first_reason, row.first_row):
        said = f"what the layers say: {told.reason} at action {told.row}"
        raise _another(where, f"rejected for {row.first_reason} at action {row.first_row}", said)
    margin = float(told.margin) if np.isfinite(told.margin) else None
    if (row.margin_layer, row.layer_margin) != (told.name, margin):
        said = f"what the layers say: {margin} in {told.name}"
        raise _another(where, f"with a margin of {row.layer_margin} in {row.margin_layer}", said)
    touching = touching_of(verdict)
    unit, limits = _quantity(told, projected, case.context, cell)
    return RejectedExample(
        method=row.method,
        layer=told.name,
        reason=str(told.reason),
        outcome=str(told.outcome),
        rejected=alike,
        held_out=total,
        situation=row.situation,
        phase=row.phase,
        mode=row.mode,
        observation=row.observation,
        candidate=row.candidate,
        row=told.row,
        late_rows=case.context.first_index,
        margin=margin,
        unit=str(unit),
        limits=limits,
        touching=touching,
        commanded_m=case.context.last_action[POSITION].tolist(),
        raw_m=_positions(raw),
        projected_m=_positions(projected.actions),
        bodies=[
            *drawn_scene(shadow, case.context.scene, touching),
            *drawn_robot(cell, projected, case.context, verdict, touching),
        ],
    )


def _another(where: str, found: str, expected: str) -> IntegrityError:
    return IntegrityError(
        where=where,
        found=found,
        expected=expected,
        action="Table, dataset or layers are not those of one run; run the stage again.",
    )


def _quantity(
    told: LayerVerdict, projected: Projected, context: Context, cell: Cell
) -> tuple[Unit, list[float]]:
    """Unit and limits of a margin; of the projection that of what it changed too much."""
    check = next(item for item in CHECKS if item.name is told.check)
    limits = [float(limit) for limit in check.limit(cell, context)]
    if check.name is not Reason.PROJECTION_TOO_LARGE:
        return check.unit, limits
    by_position = told.margin == limits[0] - projected.position_change_m
    return (Unit.M, limits[:1]) if by_position else (Unit.RAD, limits[1:])


def _positions(actions: Array) -> list[list[float] | None]:
    rows = actions[:, POSITION]
    return [row.tolist() if np.all(np.isfinite(row)) else None for row in rows]
