"""Does something recorded explain the modes? Then a generator would only hide it.

Rows of one situation stand in nearly the same place, so comparing mode and variable inside
situations conditions on the observation. Situations share training episodes; for the test a
set of situations without a common episode is drawn, so that every episode counts once.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from genpolicy.audit.data import Array, AuditInput, Integers, Text, recorded
from genpolicy.audit.modes import Clustering
from genpolicy.audit.neighbourhoods import Neighbourhood
from genpolicy.audit.settings import AuditSettings
from genpolicy.seeds import stream
from genpolicy.statistics.conditional import conditional_test
from genpolicy.statistics.multiplicity import holm

BINS = 3
EPISODE_VARIABLES = ("operator", "object", "calibration_epoch")


@dataclass(frozen=True)
class Stratum:
    """One variable in one phase; the test's numbers are None where it was not run.

    Attributes:
        variable: Name of the variable; `channel.component` for an observed one.
        phase: Task phase.
        p_value: Permutation p-value.
        p_adjusted: After Holm over all variables and phases.
        effect: Share of the modes' entropy inside situations that it explains.
        effect_lower: Lower end of the interval.
        effect_upper: Upper end of the interval.
        n: Episodes that could tell.
        recorded: False where the variable was not recorded at all: it stays unknown.
        observed: Whether a policy sees it.
    """

    variable: str
    phase: str
    p_value: float | None
    p_adjusted: float | None
    effect: float | None
    effect_lower: float | None
    effect_upper: float | None
    n: int
    recorded: bool
    observed: bool


def resolved_by_observation(
    data: AuditInput,
    settings: AuditSettings,
    situation: Neighbourhood,
    clustering: Clustering,
) -> bool:
    """Whether one observed component already tells the clusters apart.

    Then the members do not share one observation, and a deterministic policy can follow both.
    It must order them (nearly) perfectly and differ by at least its own scale.
    """
    used = np.flatnonzero(np.isfinite(data.observation_scale))
    first = data.first_row[situation.members]
    for back in range(settings.observation_horizon):
        rows = np.maximum(situation.members - back, first)
        values = data.observation[np.ix_(rows, used)] / data.observation_scale[used]
        for mode in range(clustering.count):
            inside = clustering.labels == mode
            gap = np.abs(np.median(values[inside], axis=0) - np.median(values[~inside], axis=0))
            far = np.flatnonzero(gap >= 1.0)
            if any(_auc(values[:, j], inside) >= settings.resolved_auc for j in far):
                return True
    return False


def examine_strata(
    data: AuditInput,
    settings: AuditSettings,
    situations: dict[str, list[tuple[Neighbourhood, Clustering]]],
    *,
    root_seed: int,
) -> tuple[Stratum, ...]:
    """Test every recorded variable against the modes of every phase.

    Args:
        data: Canonical audit input.
        settings: Permutations, family-wise error.
        situations: Situations with several modes, per phase.
        root_seed: Seed of the draws.

    Returns:
        One row per variable and phase, adjusted together; not recorded ones untested.
    """
    rows: list[Stratum] = []
    for phase, items in sorted(situations.items()):
        members, labels, blocks = _disjoint(data, items, phase, root_seed)
        for variable, values, observed in _variables(data, members):
            if values is None:
                rows.append(_unknown(variable, phase))
                continue
            rng = stream(root_seed, "audit", "strata", phase, variable)
            test = conditional_test(
                labels,
                _binned(values, blocks) if values.dtype.kind == "f" else values,
                blocks,
                rng=rng,
                permutations=settings.permutations,
            )
            rows.append(
                Stratum(
                    variable=variable,
                    phase=phase,
                    p_value=test.p_value,
                    p_adjusted=None,
                    effect=test.effect,
                    effect_lower=test.effect_lower,
                    effect_upper=test.effect_upper,
                    n=test.n,
                    recorded=True,
                    observed=observed,
                )
            )
    return _adjusted(rows)


def _disjoint(
    data: AuditInput,
    items: list[tuple[Neighbourhood, Clustering]],
    phase: str,
    root_seed: int,
) -> tuple[Integers, Integers, Integers]:
    """Rows, modes and block of situations; each episode only in the first one that has it."""
    order = stream(root_seed, "audit", "blocks", phase).permutation(len(items))
    taken: set[int] = set()
    rows, labels, blocks = [], [], []
    for block, number in enumerate(order):
        situation, clustering = items[int(number)]
        for row, label in zip(situation.members, clustering.labels, strict=True):
            episode = int(data.episode[row])
            if episode not in taken:
                taken.add(episode)
                rows.append(int(row))
                labels.append(int(label))
                blocks.append(block)
    return (
        np.asarray(rows, dtype=np.int64),
        np.asarray(labels, dtype=np.int64),
        np.asarray(blocks, dtype=np.int64),
    )


def _variables(
    data: AuditInput, rows: Integers
) -> list[tuple[str, NDArray[np.generic] | None, bool]]:
    """Name, value of each row (None: not recorded) and whether a policy sees it."""
    episode, table = data.episode[rows], data.episodes
    result: list[tuple[str, NDArray[np.generic] | None, bool]] = []
    for name in EPISODE_VARIABLES:
        values: Text = getattr(table, name)
        result.append((name, values[episode] if recorded(values) else None, False))
    ordered = bool(np.all(np.isfinite(table.order)))
    result.append(("episode_order", table.order[episode] if ordered else None, False))
    result.append(("time_in_episode", data.index[rows].astype(np.float64), False))
    start = data.position[data.first_row[rows]]
    for axis in range(start.shape[1]):
        result.append((f"start_position.{axis}", start[:, axis], True))
    for name, part in data.context.items():
        for column in range(part.start, part.stop):
            label = data.observation_names[column] if data.observation_names else f"{name}.{column}"
            result.append((label, data.observation[rows, column], True))
    return result


def _binned(values: NDArray[np.generic], blocks: Integers) -> Integers:
    """Thirds of the values inside each block; equal values share a bin."""
    result = np.zeros(len(values), dtype=np.int64)
    for block in np.unique(blocks):
        inside = np.flatnonzero(blocks == block)
        part = np.asarray(values[inside], dtype=np.float64)
        cuts = np.quantile(part, np.arange(1, BINS) / BINS)
        result[inside] = np.searchsorted(cuts, part, side="left")
    return result


def _adjusted(rows: list[Stratum]) -> tuple[Stratum, ...]:
    tested = [number for number, row in enumerate(rows) if row.p_value is not None and row.n > 0]
    p_values = np.array([rows[number].p_value for number in tested], dtype=np.float64)
    adjusted = dict(zip(tested, holm(p_values), strict=True))
    result = []
    for number, row in enumerate(rows):
        value = float(adjusted[number]) if number in adjusted else row.p_value
        result.append(Stratum(**{**row.__dict__, "p_adjusted": value}))
    return tuple(result)


def _unknown(variable: str, phase: str) -> Stratum:
    return Stratum(variable, phase, None, None, None, None, None, 0, False, False)


def _auc(values: Array, inside: NDArray[np.bool_]) -> float:
    """Share of pairs that the value orders one way, the better of the two ways."""
    pairs = values[inside][:, None] - values[~inside][None]
    share = float(np.mean((pairs > 0) + 0.5 * (pairs == 0)))
    return max(share, 1.0 - share)
