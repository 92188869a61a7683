"""Rows of `candidates.parquet`: what the six layers said of a candidate, and what it measures."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from genpolicy.contract.action import POSITION
from genpolicy.evidence.rows.shadow import CandidateRow
from genpolicy.evidence.shadow.case import Case
from genpolicy.evidence.shadow.layer_margins import (
    LayerMargin,
    columns_of,
    decides,
    gauges_of,
    in_order,
    layer_margins,
)
from genpolicy.evidence.shadow.observations import Observation
from genpolicy.feasibility.admission import Admitted, FeasibilityChecker, Rejected
from genpolicy.feasibility.settings import LAYERS
from genpolicy.feasibility.verdict import LayerOutcome, Verdict
from genpolicy.integrity.hashing import sha256_bytes
from genpolicy.integrity.rows import columns_of as names_of
from genpolicy.tasks.api import Task

HASHED = ("margins", "raw", "projected")
"""Columns that a journal states by their hash."""
IN_THE_VERDICT = (
    "method", "seed", "fixture", "situation", "phase", "observation", "candidate", "first_reason",
    *LAYERS,
)  # fmt: skip
"""Columns that a journal states elsewhere, or that no journal names."""
MEASURED = tuple(name for name in names_of(CandidateRow) if name not in (*IN_THE_VERDICT, *HASHED))
"""Columns that it states beside the verdict."""


@dataclass(frozen=True)
class RowLabels:
    """What the candidates of one observation have in common.

    Attributes:
        seed: Number of the training seed.
        fixture: What is tested.
        item: The observation.
        number: Its number.
    """

    seed: int
    fixture: str
    item: Observation
    number: int


def candidate_row(
    checker: FeasibilityChecker,
    task: Task,
    labels: RowLabels,
    case: Case,
    result: Admitted | Rejected,
    *,
    candidate: int,
) -> CandidateRow:
    """The row of one candidate.

    Args:
        checker: Gave the verdict; says which action offends first.
        task: Names the mode of its path.
        labels: What the candidates of its observation have in common.
        case: The candidate, and what it was checked against.
        result: What was decided.
        candidate: Its number.
    """
    item, projected, raw = labels.item, result.projected, case.proposal.actions
    verdict = checker.located(projected, result.verdict, context=case.context)
    found = layer_margins(verdict, gauges_of(checker))
    layer = decides(found)
    decided = found.get(layer, LayerMargin(str(LayerOutcome.PASSED)))
    mode = "none"
    if np.all(np.isfinite(raw)):
        mode = task.mode_of(raw[:, POSITION], item.history[-1])
    jerk = checker.boundary_jerk_m_s3(projected, context=case.context)
    passed: dict[str, Any] = {layer.name: layer.passed for layer in verdict.layers}
    return CandidateRow(
        method=case.proposal.metadata.method,
        seed=labels.seed,
        fixture=labels.fixture,
        situation=f"{item.episode_uuid}:{item.index}",
        phase=item.phase,
        observation=labels.number,
        candidate=candidate,
        mode=mode,
        **{name: passed[name] for name in LAYERS},
        outcome=str(LayerOutcome.PASSED if verdict.first is None else verdict.first.outcome),
        first_reason=str(verdict.first_reason or ""),
        first_row=decided.row,
        margin_layer=layer,
        margin_check=decided.check,
        layer_margin=decided.margin,
        margin_unit=decided.unit,
        position_change_m=_finite(projected.position_change_m),
        rotation_change_rad=_finite(projected.rotation_change_rad),
        boundary_jerk_m_s3=_finite(jerk),
        **columns_of(found),
        margins=in_order(verdict.margins),
        raw=tuple(raw.ravel().tolist()),
        projected=tuple(projected.actions.ravel().tolist()),
    )


def measures_of(row: CandidateRow) -> dict[str, Any]:
    """What a row states beside the verdict, for the journal; arrays by their hash."""
    plain = {name: getattr(row, name) for name in MEASURED}
    return plain | {f"{name}_sha256": numbers_sha256(getattr(row, name)) for name in HASHED}


def numbers_sha256(values: Sequence[float]) -> str:
    """SHA-256 of numbers as little-endian float64; every NaN is the same one."""
    numbers = np.array(values, dtype="<f8")
    numbers[np.isnan(numbers)] = np.nan
    return sha256_bytes(numbers.tobytes())


def touching_of(verdict: Verdict) -> list[str]:
    """Names of the two shapes that a refused verdict says touch; empty where it names none."""
    return verdict.detail.partition(" at row ")[0].split(" and ") if verdict.detail else []


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
