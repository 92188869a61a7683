"""Effect of a variant against a reference, paired by held-out episode, with its interval."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, TypeVar

import numpy as np
import scipy
from numpy.typing import NDArray

from genpolicy.evidence.rows.need import EffectRow, FactorErrorRow, FactorModeRow

Array = NDArray[np.float64]
Measured = TypeVar("Measured", FactorErrorRow, FactorModeRow)

SEVERAL = 2


@dataclass(frozen=True)
class Compared:
    """A variant and convention, and what it is held against.

    Attributes:
        variant: The variant.
        convention: How its samples were drawn.
        factor: The factor that it changes.
        reference: Variant and convention to hold it against.
        error: Which error; that of the first action for a policy of one action.
        confidence: Coverage of the interval of each effect.
    """

    variant: str
    convention: str
    factor: str
    reference: tuple[str, str]
    error: Literal["chunk_error", "first_error"]
    confidence: float


def effect_rows(
    errors: Sequence[FactorErrorRow], modes: Sequence[FactorModeRow], compared: Compared
) -> list[EffectRow]:
    """Error, mode coverage and valid share of a variant, and their difference to the reference.

    Args:
        errors: Rows of `errors.parquet`.
        modes: Rows of `modes.parquet`.
        compared: Who is held against whom.

    Returns:
        One row per measure: value, reference value, effect, its interval (t over episodes),
        episodes. NaN where nothing was measured.
    """
    own = (compared.variant, compared.convention)
    several = [row for row in modes if row.modes_present >= SEVERAL]
    measures: dict[str, list[dict[str, float]]] = {
        compared.error: [
            _by_episode(errors, pair, lambda row: getattr(row, compared.error))
            for pair in (own, compared.reference)
        ],
        "mode_coverage": [
            _by_episode(several, pair, lambda row: row.modes_covered / row.modes_present)
            for pair in (own, compared.reference)
        ],
        "valid_share": [_by_episode(several, pair, valid) for pair in (own, compared.reference)],
    }
    result = []
    for name, (mine, base) in measures.items():
        shared = sorted(mine.keys() & base.keys())
        gains = np.array([mine[episode] - base[episode] for episode in shared])
        half = half_width(gains, compared.confidence)
        effect = float(gains.mean()) if len(gains) else math.nan
        result.append(
            EffectRow(
                variant=compared.variant,
                factor=compared.factor,
                convention=compared.convention,
                measure=name,
                value=_mean([mine[episode] for episode in shared]),
                reference=_mean([base[episode] for episode in shared]),
                effect=effect,
                lower=effect - half,
                upper=effect + half,
                episodes=len(shared),
            )
        )
    return result


def valid(row: FactorModeRow) -> float:
    """Share of the samples that pass the six layers, where a mode is reached at all; else 0."""
    return row.admissible / row.samples if row.modes_covered >= 1 else 0.0


def half_width(gains: Array, confidence: float) -> float:
    """Half of the t interval of a mean, which covers it with `confidence`; NaN below two values."""
    if len(gains) < SEVERAL:
        return math.nan
    quantile = float(scipy.stats.t.isf((1.0 - confidence) / 2.0, len(gains) - 1))
    return quantile * float(gains.std(ddof=1)) / math.sqrt(len(gains))


def _by_episode(
    rows: Sequence[Measured], pair: tuple[str, str], value: Callable[[Measured], float]
) -> dict[str, float]:
    found: dict[str, list[float]] = {}
    for row in rows:
        if (row.variant, row.convention) == pair:
            found.setdefault(row.episode_uuid, []).append(float(value(row)))
    return {episode: _mean(values) for episode, values in found.items()}


def _mean(values: list[float]) -> float:
    return float(np.mean(values)) if values else math.nan
