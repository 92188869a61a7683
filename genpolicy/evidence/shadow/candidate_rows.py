"""Rows of `candidates.parquet`: what the six layers said of a candidate, and what it measures."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from genpolicy.contract.action import POSITION
from genpolicy.evidence.rows.shadow import CandidateRow
from genpolicy.evidence.shadow.case import Case
from genpolicy.evidence.shadow.observations import Observation
from genpolicy.feasibility.admission import Admitted, FeasibilityChecker, Rejected
from genpolicy.feasibility.settings import LAYERS
from genpolicy.feasibility.verdict import LayerOutcome, LayerVerdict, Verdict
from genpolicy.integrity.hashing import sha256_bytes
from genpolicy.tasks.api import Task


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
    decided = verdict.first or _tightest(verdict)
    mode = "none"
    if np.all(np.isfinite(raw)):
        mode = task.mode_of(raw[:, POSITION], item.history[-1])
    jerk = checker.boundary_jerk_m_s3(projected, context=case.context)
    passed = {layer.name: layer.passed for layer in verdict.layers}
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
        layer_margin=_finite(decided.margin),
        margin_unit=str(decided.unit or ""),
        position_change_m=_finite(projected.position_change_m),
        rotation_change_rad=_finite(projected.rotation_change_rad),
        boundary_jerk_m_s3=_finite(jerk),
        raw=tuple(raw.ravel().tolist()),
        projected=tuple(projected.actions.ravel().tolist()),
    )


def measures_of(row: CandidateRow) -> dict[str, Any]:
    """What a row states beside the verdict, for the journal; arrays by their hash."""
    return {
        "mode": row.mode,
        "outcome": row.outcome,
        "first_row": row.first_row,
        "layer_margin": row.layer_margin,
        "margin_unit": row.margin_unit,
        "position_change_m": row.position_change_m,
        "rotation_change_rad": row.rotation_change_rad,
        "boundary_jerk_m_s3": row.boundary_jerk_m_s3,
        "raw_sha256": numbers_sha256(row.raw),
        "projected_sha256": numbers_sha256(row.projected),
    }


def numbers_sha256(values: Sequence[float]) -> str:
    """SHA-256 of numbers as little-endian float64; every NaN is the same one."""
    numbers = np.array(values, dtype="<f8")
    numbers[np.isnan(numbers)] = np.nan
    return sha256_bytes(numbers.tobytes())


def touching_of(verdict: Verdict) -> list[str]:
    """Names of the two shapes that a refused verdict says touch; empty where it names none."""
    return verdict.detail.partition(" at row ")[0].split(" and ") if verdict.detail else []


def _tightest(verdict: Verdict) -> LayerVerdict:
    """The layer with the smallest margin that is a number; of a chunk that passed."""
    return min(verdict.layers, key=lambda v: v.margin if np.isfinite(v.margin) else np.inf)


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
