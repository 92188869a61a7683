"""Does the past explain the modes? Then a variable decides that nobody recorded.

Rows of one situation show one observation. If their modes can be told from what was seen well
before, beyond the observation horizon, then something decided earlier: a cue that has gone, an
intent, a different way here. A policy with the present horizon cannot see it, and a generator
would only hide it. Valid modes leave no such trace: nothing in the past knows the choice.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from genpolicy.audit.data import Array, AuditInput, Flags, Integers
from genpolicy.audit.settings import AuditSettings

OCTAVES = 4
CHANCE = 1e-12


@dataclass(frozen=True)
class HistoryTest:
    """Association of the modes with the past.

    Attributes:
        p_value: Permutation p-value of the largest association over all features of the past.
        effect: How much of a perfect order by mode the best feature shows inside situations,
            beyond what the best of as many random ones does; 0 to 1.
        effect_lower: Lower end of the jackknife interval.
        effect_upper: Upper end.
        present: The same share for the best feature of the present observation.
        feature: What explains best, in words.
        n: Rows that have a past to look at.
    """

    p_value: float
    effect: float
    effect_lower: float
    effect_upper: float
    present: float
    feature: str
    n: int


def history_test(
    data: AuditInput,
    settings: AuditSettings,
    *,
    rows: Integers,
    labels: Integers,
    blocks: Integers,
    rng: np.random.Generator,
) -> HistoryTest:
    """Test what was seen at least half a chunk ago against the modes.

    The largest within-situation correlation ratio over all features is held against its own
    distribution under modes dealt anew inside the situations, so the many features cost nothing
    in error rate.

    Args:
        data: Canonical audit input.
        settings: Horizons and number of permutations.
        rows: Rows of situations without a common episode. Shape (n,).
        labels: Mode of each. Shape (n,).
        blocks: Situation of each. Shape (n,).
        rng: Generator of the permutations.

    Returns:
        The test; p-value 1 where no row has a past that long.
    """
    gap = shortest_gap(settings)
    past = rows - data.first_row[rows] >= gap
    keep = past & _several(labels, blocks, past)
    rows, labels, blocks = rows[keep], labels[keep], blocks[keep]
    if len(rows) == 0:
        return HistoryTest(1.0, 0.0, 0.0, 1.0, 0.0, "", 0)
    cell = np.unique(blocks, return_inverse=True)[1].reshape(-1)
    features, names = past_features(data, settings, rows)
    past_values = centred_ranks(features, cell)
    now_values = centred_ranks(present_features(data, settings, rows), cell)
    draws = np.stack([_dealt(labels, cell, rng) for _ in range(settings.permutations)])
    null = np.array([_ratio(past_values, draw, cell).max(initial=0.0) for draw in draws])
    null_now = np.array([_ratio(now_values, draw, cell).max(initial=0.0) for draw in draws[:99]])
    observed = _ratio(past_values, labels, cell)
    best = int(np.argmax(observed))
    hits = int(np.count_nonzero(null >= observed[best] - CHANCE))
    chosen = past_values[:, best]
    point = _share_of(past_values, labels, cell, null)
    half = 2.0 * _jackknife(chosen[:, None], labels, cell) / _perfect(chosen, labels, cell)
    return HistoryTest(
        p_value=(1 + hits) / (settings.permutations + 1),
        effect=point,
        effect_lower=max(0.0, point - half),
        effect_upper=min(1.0, point + half),
        present=_share_of(now_values, labels, cell, null_now),
        feature=names[best],
        n=len(rows),
    )


def shortest_gap(settings: AuditSettings) -> int:
    """Steps between the present and the youngest past that counts.

    Half a chunk: demonstrators that have just begun to move apart must not seem to have known.
    """
    return max(settings.observation_horizon, settings.chunk_rows // 2)


def past_features(
    data: AuditInput, settings: AuditSettings, rows: Integers
) -> tuple[Array, list[str]]:
    """What was seen before, at doubling distances, at the start, and its extremes and mean.

    Args:
        data: Canonical audit input.
        settings: Horizons.
        rows: Rows with a past of at least `shortest_gap`. Shape (n,).

    Returns:
        Features, shape (n, F), and a name for each.
    """
    gap, first = shortest_gap(settings), data.first_row[rows]
    parts: list[Array] = []
    names: list[str] = []

    def add(values: Array, text: str) -> None:
        parts.append(values)
        names.extend(f"{name} {text}" for name in data.observation_names)

    add(data.observation[first], "at the start")
    for octave in range(OCTAVES):
        steps = gap << octave
        add(data.observation[np.maximum(rows - steps, first)], f"{steps} steps earlier")
    summaries = [
        _summary(data.observation[a : r - gap + 1]) for a, r in zip(first, rows, strict=True)
    ]
    lowest, highest, mean = (np.stack(part) for part in zip(*summaries, strict=True))
    add(lowest, "at its lowest so far")
    add(highest, "at its highest so far")
    add(mean, "on average so far")
    return np.concatenate(parts, axis=1), names


def _summary(values: Array) -> tuple[Array, Array, Array]:
    return values.min(axis=0), values.max(axis=0), values.mean(axis=0)


def present_features(data: AuditInput, settings: AuditSettings, rows: Integers) -> Array:
    """The observations that the policy sees, and their changes. Shape (n, F)."""
    first = data.first_row[rows]
    seen = [
        data.observation[np.maximum(rows - back, first)]
        for back in range(settings.observation_horizon)
    ]
    return np.concatenate(seen + [a - b for a, b in pairwise(seen)], axis=1)


def _several(labels: Integers, blocks: Integers, keep: Flags) -> Flags:
    """Rows of blocks that keep at least two modes."""
    result = np.zeros(len(labels), dtype=bool)
    for block in np.unique(blocks):
        inside = blocks == block
        result[inside] = len(np.unique(labels[inside & keep])) > 1
    return result


def centred_ranks(values: Array, cell: Integers) -> Array:
    """Ranks inside the blocks, centred: one far value must not decide.

    Args:
        values: Shape (n, F).
        cell: Block of each row. Shape (n,).

    Returns:
        Shape (n, F).
    """
    result = np.zeros_like(values)
    for block in np.unique(cell):
        inside = np.flatnonzero(cell == block)
        part = np.round(values[inside], 9)
        below = (part[None] < part[:, None]).sum(axis=1)
        ties = (part[None] == part[:, None]).sum(axis=1)
        ranks = below + 0.5 * (ties - 1)
        result[inside] = ranks - ranks.mean(axis=0)
    return result


def _ratio(values: Array, labels: Integers, cell: Integers) -> Array:
    """Share of each feature's variance inside the blocks between the modes of a block (F,)."""
    group = cell * (int(labels.max()) + 1) + labels
    kinds, place = np.unique(group, return_inverse=True)
    one = np.zeros((len(kinds), len(values)))
    one[place.reshape(-1), np.arange(len(values))] = 1.0
    sums = one @ values
    between = np.sum(sums**2 / one.sum(axis=1)[:, None], axis=0)
    total = np.sum(values**2, axis=0)
    return np.asarray(np.where(total > CHANCE, between / np.maximum(total, CHANCE), 0.0))


def _dealt(labels: Integers, cell: Integers, rng: np.random.Generator) -> Integers:
    """The labels dealt anew inside their blocks. Shape (n,)."""
    order = np.argsort(cell, kind="stable")
    shuffled = np.lexsort((rng.random(len(labels)), cell))
    result = np.empty_like(labels)
    result[order] = labels[shuffled]
    return result


def _share_of(values: Array, labels: Integers, cell: Integers, null: Array) -> float:
    """How much of a perfect order the best of all features shows beyond chance."""
    shares = _ratio(values, labels, cell)
    best = int(np.argmax(shares))
    return _beyond(float(shares[best]), null, _perfect(values[:, best], labels, cell))


def _perfect(values: Array, labels: Integers, cell: Integers) -> float:
    """The share if the same values were dealt in the order of the modes."""
    sorted_labels = np.empty_like(labels)
    for block in np.unique(cell):
        inside = np.flatnonzero(cell == block)
        kinds = np.unique(labels[inside])
        centres = [float(values[inside][labels[inside] == kind].mean()) for kind in kinds]
        counts = [int(np.count_nonzero(labels[inside] == kind)) for kind in kinds]
        order = np.argsort(centres, kind="stable")
        dealt = np.repeat(kinds[order], np.array(counts)[order])
        sorted_labels[inside[np.argsort(values[inside], kind="stable")]] = dealt
    return max(float(_ratio(values[:, None], sorted_labels, cell)[0]), CHANCE)


def _beyond(observed: float, null: Array, perfect: float) -> float:
    """Share of the way from chance to a perfect order, 0 to 1."""
    chance = float(null.mean()) if len(null) else 0.0
    return min(1.0, max(0.0, (observed - chance) / max(perfect - chance, CHANCE)))


def _jackknife(values: Array, labels: Integers, cell: Integers) -> float:
    """Standard error of the share, each row left out once. Source: Efron and Stein 1981."""
    n = len(values)
    rest = [np.delete(np.arange(n), k) for k in range(n)]
    shares = np.array([float(_ratio(values[k], labels[k], cell[k])[0]) for k in rest])
    return float(np.sqrt((n - 1) / n * np.sum((shares - shares.mean()) ** 2)))
