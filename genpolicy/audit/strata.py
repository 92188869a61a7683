"""Does something recorded explain the modes? Then a generator would only hide it.

Rows of one situation stand in nearly the same place, so comparing mode and variable inside
situations conditions on the observation. Situations share training episodes; for the test a
set of situations without a common episode is drawn, so that every episode counts once.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from genpolicy.audit.columns import Asking, column_strata
from genpolicy.audit.data import Array, AuditInput, Integers, Text, recorded
from genpolicy.audit.history import history_test
from genpolicy.audit.modes import Clustering
from genpolicy.audit.neighbourhoods import Neighbourhood
from genpolicy.audit.resolution import observed_gap
from genpolicy.audit.rows import Stratum
from genpolicy.audit.settings import AuditSettings
from genpolicy.audit.stored import STORED, sequence_test
from genpolicy.audit.variable import EPISODE_VARIABLES, INSIDE
from genpolicy.seeds import stream
from genpolicy.statistics.conditional import conditional_test
from genpolicy.statistics.multiplicity import holm

BINS = 3
Variable = tuple[str, NDArray[np.generic] | None, bool]

HISTORY = "history"
SEQUENCE = "recording_sequence"
# Same side in turns of two, or for a session: both show in the episodes two and four places off.
SEQUENCE_PLACES = (-4, -2, 2, 4)
# A cluster that has begun to move apart by half a scale is no longer a matter of the past.
STILL_TOGETHER = 0.5
Drawn = tuple[Integers, Integers, Integers]


def examine_strata(
    data: AuditInput,
    settings: AuditSettings,
    situations: dict[str, list[tuple[Neighbourhood, Clustering]]],
    links: dict[str, Integers],
    *,
    root_seed: int,
) -> tuple[Stratum, ...]:
    """Test every recorded variable, and the unrecorded past, against the modes of every phase.

    Args:
        data: Canonical audit input.
        settings: Permutations, family-wise error.
        situations: Situations with several modes, per phase.
        links: Mode of each episode, -1 for none, per phase. Shape (E,).
        root_seed: Seed of the draws.

    Returns:
        One row per variable and phase, adjusted together; not recorded ones untested.
    """
    rows: list[Stratum] = []
    settings = _enough_permutations(data, settings, len(situations))
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
        past = _disjoint(data, items, _together(closest, np.sort(gaps)), least)
        tested = [(*entry, hidden) for entry in _hidden_variables(data, hidden[0], links[phase])]
        # Routes of different length are at another time as soon as they part.
        tested.append(("time_in_episode", data.index[past[0]].astype(np.float64), False, past))
        tested += [(*entry, seen) for entry in _observed_variables(data, seen[0])]
        for variable, values, observed, place in tested:
            seeds = (root_seed, phase, variable)
            row = _tested(settings, seeds, values, place, observed=observed)
            inside = variable in (data.phase_name, "time_in_episode") and row.recorded
            row = replace(row, detail=INSIDE if inside else "")
            if variable == SEQUENCE:
                row = _in_turns(data, row, hidden, links[phase], root_seed)
            rows.append(row)
        rows += column_strata(data, settings, hidden, Asking(phase, root_seed))
        rows.append(_history(data, settings, phase, past, root_seed))
    return _adjusted(rows)


def _enough_permutations(data: AuditInput, settings: AuditSettings, phases: int) -> AuditSettings:
    """So many permutations that the smallest p-value survives the correction for all tests."""
    context = sum(part.stop - part.start for part in data.context.values())
    tests = len(EPISODE_VARIABLES) + 5 + data.position.shape[1] + context + len(data.variables)
    tests *= phases
    least = int(np.ceil(2 * tests / settings.strata_resolution))
    if settings.permutations >= least:
        return settings
    return settings.model_copy(update={"permutations": least})


def _together(closest: Integers, gaps: Array) -> Integers:
    """Situations whose clusters are still in one place; if there is none, the closest quarter."""
    together = closest[gaps < STILL_TOGETHER]
    if len(together):
        return together
    return closest[: len(closest) // 4][gaps[: len(closest) // 4] < 2 * STILL_TOGETHER]


def _tested(
    settings: AuditSettings,
    seeds: tuple[int, str, str],
    values: NDArray[np.generic] | None,
    drawn: Drawn,
    *,
    observed: bool,
) -> Stratum:
    root_seed, phase, variable = seeds
    if values is None:
        return _unknown(variable, phase)
    _, labels, blocks = drawn
    test = conditional_test(
        labels,
        _binned(values, blocks) if values.dtype.kind == "f" else values,
        blocks,
        rng=stream(root_seed, "audit", "strata", phase, variable),
        permutations=settings.permutations,
    )
    return Stratum(
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


def _in_turns(
    data: AuditInput, row: Stratum, drawn: Drawn, links: Integers, root_seed: int
) -> Stratum:
    """The sequence by a pattern over all starts where there is one; else as it was tested.

    Without an order of recording the places in the files are asked for a pattern, and only that.
    """
    place = data.episodes.order if row.recorded else data.stored
    if place is None:
        return row
    test = sequence_test(data, place, links, drawn, seeds=(root_seed, row.phase))
    if test is None or (row.recorded and test.effect <= (row.effect or 0.0)):
        return row
    return Stratum(
        variable=SEQUENCE,
        phase=row.phase,
        p_value=test.p_value,
        p_adjusted=None,
        effect=test.effect,
        effect_lower=test.effect_lower,
        effect_upper=test.effect_upper,
        n=test.n,
        recorded=True,
        observed=False,
        detail=row.detail if row.recorded else STORED,
    )


def _history(
    data: AuditInput, settings: AuditSettings, phase: str, drawn: Drawn, root_seed: int
) -> Stratum:
    rows, labels, blocks = drawn
    rng = stream(root_seed, "audit", "strata", phase, HISTORY)
    test = history_test(data, settings, rows=rows, labels=labels, blocks=blocks, rng=rng)
    # What the present shows as well is no matter of the past.
    effect = test.effect if test.effect - test.present > 0 else 0.0
    return Stratum(
        variable=HISTORY,
        phase=phase,
        p_value=test.p_value,
        p_adjusted=None,
        effect=effect,
        effect_lower=min(effect, test.effect_lower),
        effect_upper=test.effect_upper,
        n=test.n,
        recorded=True,
        observed=False,
        detail=test.feature,
    )


def _disjoint(
    data: AuditInput,
    items: list[tuple[Neighbourhood, Clustering]],
    order: Integers,
    least: int,
) -> Drawn:
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


def _hidden_variables(data: AuditInput, rows: Integers, links: Integers) -> list[Variable]:
    """Name, value of each row (None: not recorded) and that no policy sees it."""
    episode, table = data.episode[rows], data.episodes
    result: list[Variable] = []
    if not data.phase_observed:
        known = len(np.unique(data.phase)) > 1
        result.append((data.phase_name, data.phase[rows] if known else None, False))
    for name in EPISODE_VARIABLES:
        values: Text = getattr(table, name)
        result.append((name, values[episode] if recorded(values) else None, False))
    ordered = bool(np.all(np.isfinite(table.order)))
    result.append(("episode_order", table.order[episode] if ordered else None, False))
    nearby = _nearby_mode(table.order, links)[episode] if ordered else None
    result.append((SEQUENCE, nearby, False))
    return result


def _nearby_mode(order: NDArray[np.float64], links: Integers) -> Integers:
    """Most frequent mode of episodes recorded shortly before and after each; -1 for a tie (E,)."""
    sequence = np.argsort(order, kind="stable")
    inside = links[sequence]
    n, kinds = len(order), int(links.max(initial=-1)) + 1
    votes = np.zeros((n, kinds + 1))
    for place in SEQUENCE_PLACES:
        other = np.arange(n) + place
        valid = (other >= 0) & (other < n)
        votes[np.flatnonzero(valid), inside[other[valid]]] += 1.0
    votes = votes[:, :kinds]  # the last column counts episodes without a mode
    result = np.full(n, -1, dtype=np.int64)
    if kinds:
        ranked = np.sort(votes, axis=1)
        clear = ranked[:, -1] > (ranked[:, -2] if kinds > 1 else 0.0)
        result[sequence] = np.where(clear, np.argmax(votes, axis=1), -1)
    return result


def _observed_variables(data: AuditInput, rows: Integers) -> list[Variable]:
    """Start position and context channels of each row.

    A policy sees the context, and the start as long as it has not left it.
    """
    start = data.position[data.first_row[rows]]
    scale = data.observation_scale[data.observation_position]
    moved = np.linalg.norm((data.position[rows] - start) / scale, axis=1)
    fresh = bool(np.median(moved) < STILL_TOGETHER) if len(rows) else True
    result: list[Variable] = [
        (f"start_position.{axis}", start[:, axis], fresh) for axis in range(start.shape[1])
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
        result.append(replace(row, p_adjusted=value))
    return tuple(result)


def _unknown(variable: str, phase: str) -> Stratum:
    return Stratum(variable, phase, None, None, None, None, None, 0, False, False)
