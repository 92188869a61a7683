"""Effect of a variant against a reference, paired by held-out episode, with its interval."""

import math
from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray
from scipy import stats

Array = NDArray[np.float64]
Rows = Sequence[dict[str, Any]]

CONFIDENCE = 0.95
SEVERAL = 2


def effect_rows(
    errors: Rows,
    modes: Rows,
    *,
    own: tuple[str, str],
    reference: tuple[str, str],
    error: Literal["chunk_error", "first_error"],
) -> list[dict[str, Any]]:
    """Error, mode coverage and valid share of a variant, and their difference to the reference.

    Args:
        errors: Rows of `errors.parquet`.
        modes: Rows of `modes.parquet`.
        own: Variant and convention.
        reference: Variant and convention to hold it against.
        error: Which error; that of the first action for a policy of one action.

    Returns:
        One row per measure: value, reference value, effect, its interval (t over episodes, of
        confidence 0.95), episodes. NaN where nothing was measured.
    """
    several = [row for row in modes if row["modes_present"] >= SEVERAL]
    measures = {
        error: (errors, lambda row: row[error]),
        "mode_coverage": (several, lambda row: row["modes_covered"] / row["modes_present"]),
        "valid_share": (several, valid),
    }
    result = []
    for name, (rows, value) in measures.items():
        mine, base = (_by_episode(rows, pair, value) for pair in (own, reference))
        shared = sorted(mine.keys() & base.keys())
        gains = np.array([mine[episode] - base[episode] for episode in shared])
        half = half_width(gains)
        effect = float(gains.mean()) if len(gains) else math.nan
        result.append(
            {
                "measure": name,
                "value": _mean([mine[episode] for episode in shared]),
                "reference": _mean([base[episode] for episode in shared]),
                "effect": effect,
                "lower": effect - half,
                "upper": effect + half,
                "episodes": len(shared),
            }
        )
    return result


def valid(row: dict[str, Any]) -> float:
    """Share of the samples that pass the six layers, where a mode is reached at all; else 0."""
    return float(row["admissible"] / row["samples"]) if row["modes_covered"] >= 1 else 0.0


def half_width(gains: Array) -> float:
    """Half of the t interval of a mean; NaN below two values."""
    if len(gains) < SEVERAL:
        return math.nan
    quantile = float(stats.t.isf((1.0 - CONFIDENCE) / 2.0, len(gains) - 1))
    return quantile * float(gains.std(ddof=1)) / math.sqrt(len(gains))


def _by_episode(rows: Rows, pair: tuple[str, str], value: Any) -> dict[str, float]:
    found: dict[str, list[float]] = {}
    for row in rows:
        if (row["variant"], row["convention"]) == pair:
            found.setdefault(row["episode_uuid"], []).append(float(value(row)))
    return {episode: _mean(values) for episode, values in found.items()}


def _mean(values: list[float]) -> float:
    return float(np.mean(values)) if values else math.nan


EFFECTS = pa.schema(
    [
        ("variant", pa.string()), ("factor", pa.string()), ("convention", pa.string()),
        ("measure", pa.string()), ("value", pa.float64()), ("reference", pa.float64()),
        ("effect", pa.float64()), ("lower", pa.float64()), ("upper", pa.float64()),
        ("episodes", pa.int64()),
    ]
)  # fmt: skip
