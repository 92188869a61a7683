"""Does something recorded explain the modes? Then a generator would only hide it.

Rows of one situation stand in nearly the same place, so comparing mode and variable inside
situations conditions on the observation. Situations share training episodes; for the test a
set of situations without a common episode is drawn, so that every episode counts once.
"""

from collections.abc import Iterator
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
Variable = tuple[str, NDArray[np.generic] | None, bool]

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
    for values, inside in _observed(data, settings, situation, clustering):
        gap = np.abs(np.median(values[inside], axis=0) - np.median(values[~inside], axis=0))
        far = np.flatnonzero(gap >= 1.0)
        if any(_auc(values[:, j], inside) >= settings.resolved_auc for j in far):
            return True
    return False


def observed_gap(
    data: AuditInput,
    settings: AuditSettings,
    situation: Neighbourhood,
    clustering: Clustering,
) -> float:
    """Largest difference of a component's median between a cluster and the rest, in scales."""
    return max(
        float(np.max(np.abs(np.median(v[inside], axis=0) - np.median(v[~inside], axis=0))))
        for v, inside in _observed(data, settings, situation, clustering)
    )


def _observed(
    data: AuditInput,
    settings: AuditSettings,
    situation: Neighbourhood,
    clustering: Clustering,
) -> Iterator[tuple[Array, NDArray[np.bool_]]]:
    """Scaled observations of the members, per row of the history, and each cluster against all."""
    used = np.flatnonzero(np.isfinite(data.observation_scale))
    first = data.first_row[situation.members]
    for back in range(settings.observation_horizon):
        rows = np.maximum(situation.members - back, first)
        values = data.observation[np.ix_(rows, used)] / data.observation_scale[used]
        for mode in range(clustering.count):
            yield values, clustering.labels == mode


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
        drawn = stream(root_seed, "audit", "blocks", phase).permutation(len(items))
        # Hidden variables are tested where the clusters differ least in what is observed: a
        # cluster that has begun to move apart is reached at another time in the episode. The
        # order rests on modes and observations only, so the test of a hidden variable stays
        # exact; for an observed one it would not, and a random order is used.
        gaps = np.array([observed_gap(data, settings, *items[int(k)]) for k in drawn])
        closest = drawn[np.argsort(np.round(gaps, 6), kind="stable")]
        least = settings.minimum_neighbours // 2
        hidden = _disjoint(data, items, closest, least)
        seen = _disjoint(data, items, drawn, least)
        tested = [(*entry, hidden) for entry in _hidden_variables(data, hidden[0])]
        tested += [(*entry, seen) for entry in _observed_variables(data, seen[0])]
        for variable, values, observed, (_, labels, blocks) in tested:
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
    order: Integers,
    least: int,
) -> tuple[Integers, Integers, Integers]:
    """Rows, modes and block of situations taken in `order`; each episode only once.

    A situation of which fewer than `least` episodes are left is passed over.
    """
    taken: set[int] = set()
    rows, labels, blocks = [], [], []
    for number in order:
        situation, clustering = items[int(number)]
        episodes = data.episode[situation.members]
        free = [k for k, episode in enumerate(episodes) if int(episode) not in taken]
        if len(free) >= least:
            taken.update(int(episodes[k]) for k in free)
            rows += [int(situation.members[k]) for k in free]
            labels += [int(clustering.labels[k]) for k in free]
            blocks += [int(number)] * len(free)
    return (
        np.asarray(rows, dtype=np.int64),
        np.asarray(labels, dtype=np.int64),
        np.asarray(blocks, dtype=np.int64),
    )


def _hidden_variables(data: AuditInput, rows: Integers) -> list[Variable]:
    """Name, value of each row (None: not recorded) and that no policy sees it."""
    episode, table = data.episode[rows], data.episodes
    result: list[Variable] = []
    for name in EPISODE_VARIABLES:
        values: Text = getattr(table, name)
        result.append((name, values[episode] if recorded(values) else None, False))
    ordered = bool(np.all(np.isfinite(table.order)))
    result.append(("episode_order", table.order[episode] if ordered else None, False))
    result.append(("time_in_episode", data.index[rows].astype(np.float64), False))
    return result


def _observed_variables(data: AuditInput, rows: Integers) -> list[Variable]:
    """Start position and context channels of each row, which a policy sees."""
    start = data.position[data.first_row[rows]]
    result: list[Variable] = [
        (f"start_position.{axis}", start[:, axis], True) for axis in range(start.shape[1])
    ]
    for part in data.context.values():
        for column in range(part.start, part.stop):
            result.append((data.observation_names[column], data.observation[rows, column], True))
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
