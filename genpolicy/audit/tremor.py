"""Does a single number of the action tremble from row to row, beside the way that it goes?

The spread of the whole route drowns one joint of many, and a sum of noise is a smooth path. So each
number is looked at as it was recorded, a rate as a rate, and by itself.
"""

from collections.abc import Sequence

import numpy as np

from genpolicy.audit.component_rows import Tremor
from genpolicy.audit.components import STROKE_SHARE, white
from genpolicy.audit.data import Array, AuditInput, chunk_rows
from genpolicy.audit.persistence import roughness, von_neumann
from genpolicy.audit.settings import AuditSettings
from genpolicy.audit.situations import Situation

# Situations that give the numbers, evenly drawn.
MEASURED = 150
# Of all that a number does, at least this is motion; a column of noise alone commands nothing.
LEAST_MOTION = 0.1


def tremors(
    data: AuditInput,
    settings: AuditSettings,
    situations: Sequence[Situation],
) -> tuple[Tremor, ...]:
    """The white noise on every number of the action that moves; none without situations.

    Args:
        data: Canonical audit input.
        settings: Length of a chunk.
        situations: Situations whose members answer alike.
    """
    if not situations:
        return ()
    places = np.linspace(0, len(situations) - 1, min(len(situations), MEASURED)).astype(int)
    rows = [situations[place].neighbourhood.members for place in places]
    chunks = [data.action[chunk_rows(data, item, settings.chunk_rows)] for item in rows]
    motion, size = _motion(data), _sizes(data, settings)
    return tuple(
        _tremor(_name(data, column), [part[..., [column]] for part in chunks], float(size[column]))
        for column in np.flatnonzero((motion - LEAST_MOTION >= 0) & (size > 0.0)).tolist()
    )


def _tremor(name: str, chunks: Sequence[Array], size: float) -> Tremor:
    ratio, spread = np.median([von_neumann(part) for part in chunks], axis=0)
    share = float(np.median([min(1.0, roughness(part)) for part in chunks]))
    return Tremor(column=name, ratio=float(ratio), spread=float(spread) * size, white_share=share)


def _motion(data: AuditInput) -> Array:
    """Share of the variance of each number that is no white noise. Shape (D_a,)."""
    whole = data.action.std(axis=0)
    noise = white(data, data.action)
    return np.asarray(1.0 - (noise / np.where(whole > 0.0, whole, 1.0)) ** 2 - (whole == 0.0))


def _sizes(data: AuditInput, settings: AuditSettings) -> Array:
    """What 1 of each number moves, as a share of what sets two modes apart. Shape (D_a,)."""
    placed = data.placed
    low, high = np.quantile(placed, [0.01, 0.99], axis=0)
    apart = STROKE_SHARE * (high - low)
    apart[data.action_position] = settings.minimum_separation_m
    gain = np.ones(placed.shape[1]) if data.forms is None else np.abs(data.forms.gain)
    return np.asarray(np.divide(gain, apart, out=np.zeros(len(gain)), where=apart > 0.0))


def _name(data: AuditInput, column: int) -> str:
    return data.action_names[column] if data.action_names else f"action[{column}]"
