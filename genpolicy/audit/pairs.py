"""Two recorded columns that only together decide: the side of the lamp and the batch, as an xor.

Each of them tells nothing alone, and no test of single columns sees them. Every pair is another
chance of a false finding, so one is believed only where chance gives the best of all of them once
in a thousand data sets of episodes that could be exchanged, each of the two tells beyond the other,
and no single column comes near. Episodes of a session cannot be exchanged with others, so stretches
in which neither column changed must say the same, each taken whole.
Then it is a variable like any other; where there is none, the evidence is as it was, to the byte.

Source: Westfall, Young 1993 (the largest statistic of all pairs under permuted modes).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy import stats

from genpolicy.audit.data import Array, AuditInput, Integers, recorded
from genpolicy.audit.variable import EPISODE_VARIABLES, Values, Variable, numbered
from genpolicy.seeds import stream

# Cells of a pair must hold episodes: four values each are sixteen.
MOST_VALUES, MOST_COLUMNS = 4, 20
LEAST_EPISODES = 20
# Chance of a pair where there is none, and draws that resolve it.
LEVEL, DRAWS = 0.001, 1999
# Fewer stretches of episodes with one value of both say nothing.
LEAST_STRETCHES = 16
# A single column that tells half as much is what is asked about.
NEAR = 0.5
BATCH = 128
EPOCH = "calibration_epoch"
"""A calibration that parts the ways is a defect of the data, which single columns are asked for."""


@dataclass(frozen=True)
class _Pair:
    """Two columns of the episodes that have a mode. Shapes (n,)."""

    first: Integers
    second: Integers

    @property
    def cell(self) -> Integers:
        """Both values as one."""
        return self.first * MOST_VALUES + self.second


def with_pairs(
    data: AuditInput, links: Mapping[str, Integers], *, root_seed: int
) -> tuple[Variable, ...]:
    """The variables of the data, and of each phase the pair of columns that decides its modes.

    Args:
        data: Canonical audit input.
        links: Mode of each episode, -1 for none, per phase. Shape (E,).
        root_seed: Seed of the draws.
    """
    columns = _columns(data)
    found: dict[str, Variable] = {item.key: item for item in data.variables}
    for phase, modes in sorted(links.items()):
        rng = stream(root_seed, "audit", "pairs", phase)
        pair = _best(columns, _alone(data), modes, data.episodes.order, rng)
        if pair is not None:
            first, second = (dict(columns)[name] for name in pair)
            item = Variable(f"{pair[0]} with {pair[1]}", numbered(first * MOST_VALUES + second))
            found.setdefault(item.key, item)
    return tuple(found.values())


def _columns(data: AuditInput) -> list[tuple[str, Integers]]:
    """Columns of few values, one an episode, in an order that rests on what they say."""
    labels = [
        Variable(name, numbered(getattr(data.episodes, name)))
        for name in EPISODE_VARIABLES
        if name != EPOCH and recorded(getattr(data.episodes, name))
    ]
    groups = [
        item
        for item in (*labels, *data.variables)
        if not item.by_row
        and not item.is_measure
        and 1 < len(np.unique(item.values)) <= MOST_VALUES
    ]
    groups.sort(key=lambda item: (-_balance(item.values), item.key))
    return [(item.name, np.asarray(item.values, dtype=np.int64)) for item in groups[:MOST_COLUMNS]]


def _balance(values: Values) -> float:
    """Entropy of the groups: what nearly all episodes share parts them into few cells."""
    shares = np.bincount(np.asarray(values, dtype=np.int64)) / len(values)
    shares = shares[shares > 0.0]
    return round(float(-(shares * np.log(shares)).sum()), 9)


def _alone(data: AuditInput) -> list[Integers]:
    """All that may decide by itself, one value an episode; measures in thirds. Each (E,)."""
    labels = [numbered(getattr(data.episodes, name)) for name in EPISODE_VARIABLES]
    own = [item for item in data.variables if not item.by_row]
    thirds = [
        np.searchsorted(np.nanquantile(item.values, (1 / 3, 2 / 3)), item.values)
        for item in own
        if item.is_measure and np.isfinite(item.values).any()
    ]
    groups = [np.asarray(item.values, dtype=np.int64) for item in own if not item.is_measure]
    return [*labels, *groups, *thirds]


def _best(
    columns: Sequence[tuple[str, Integers]],
    alone: Sequence[Integers],
    modes: Integers,
    order: Array,
    rng: np.random.Generator,
) -> tuple[str, str] | None:
    """The pair that decides the modes, if one does."""
    known = np.flatnonzero(modes >= 0)
    mode = numbered(modes[known])
    kinds = int(mode.max(initial=-1)) + 1
    if len(known) < LEAST_EPISODES or kinds < 2:
        return None
    held = [(name, values[known]) for name, values in columns]
    pairs = list(combinations(range(len(held)), 2))
    if not pairs:
        return None
    chosen = [_Pair(held[a][1], held[b][1]) for a, b in pairs]
    one = np.eye(kinds)[mode]
    measured = np.array([_beyond(pair, one[None])[0] for pair in chosen])
    best = int(np.argmax(measured))
    # A look that costs nothing: chance has longer tails than these, and is asked by draws.
    if stats.norm.sf(measured[best]) * len(pairs) > LEVEL or _is_single(
        chosen[best], [values[known] for values in alone], one
    ):
        return None
    larger = 0
    for start in range(0, DRAWS, BATCH):
        count = min(BATCH, DRAWS - start)
        drawn = one[np.argsort(rng.random((count, len(mode))), axis=1)]
        top = np.max([_beyond(pair, drawn) for pair in chosen], axis=0)
        larger += int(np.count_nonzero(top >= measured[best]))
        if (1 + larger) / (1 + DRAWS) > LEVEL:
            return None
    if not _in_stretches(chosen[best], one, order[known], rng):
        return None
    a, b = pairs[best]
    first, second = sorted((held[a][0], held[b][0]))
    return first, second


def _beyond(pair: _Pair, modes: Array) -> Array:
    """How far each of the two tells of the modes beyond the other, the smaller of both.

    Args:
        pair: The two columns.
        modes: One column a mode, 1 where the episode has it. Shape (draws, n, K).

    Returns:
        Chi-square inside the values of the other, in standard deviations from what chance gives.
        Shape (draws,).
    """
    cells = np.eye(MOST_VALUES**2)[pair.cell]
    return _of_counts(np.einsum("dnk,nc->dkc", modes, cells, optimize=True))


def _of_counts(counts: Array) -> Array:
    """The same, of the episodes of each mode in each cell. Shape (draws, K, cells) to (draws,)."""
    counts = counts.reshape(*counts.shape[:2], MOST_VALUES, MOST_VALUES)
    return np.minimum(_inside(counts), _inside(np.swapaxes(counts, 2, 3)))


def _inside(counts: Array) -> Array:
    """Chi-square of modes by the last axis, summed over the axis before. Shape (draws,)."""
    of_mode = counts.sum(axis=3, keepdims=True)
    of_value = counts.sum(axis=1, keepdims=True)
    total = counts.sum(axis=(1, 3), keepdims=True)
    expected = of_mode * of_value / np.maximum(total, 1.0)
    chi = np.where(expected > 0.0, (counts - expected) ** 2 / np.maximum(expected, 1e-12), 0.0)
    rows = np.count_nonzero(of_mode[..., 0] > 0, axis=1)
    columns = np.count_nonzero(of_value[:, 0] > 0, axis=2)
    freedom = (np.maximum(rows - 1, 0) * np.maximum(columns - 1, 0)).sum(axis=1)
    score = (chi.sum(axis=(1, 2, 3)) - freedom) / np.sqrt(2.0 * np.maximum(freedom, 1))
    return np.asarray(np.where(freedom > 0, score, -np.inf))


def _in_stretches(pair: _Pair, one: Array, order: Array, rng: np.random.Generator) -> bool:
    """Whether whole stretches of episodes in the order of recording say it as well.

    What both columns were is drawn anew for each stretch in which they stayed the same.
    """
    if not np.all(np.isfinite(order)):
        return True  # nobody knows what was recorded together
    sequence = np.argsort(order, kind="stable")
    cell = pair.cell[sequence]
    begins = np.concatenate([[0], np.flatnonzero(np.diff(cell)) + 1])
    if len(begins) < LEAST_STRETCHES:
        return False
    modes, cells = np.add.reduceat(one[sequence], begins, axis=0), cell[begins]
    measured = _of_counts(_cells(modes, cells[None]))[0]
    larger = 0
    for start in range(0, DRAWS, BATCH):
        drawn = rng.permuted(np.tile(cells, (min(BATCH, DRAWS - start), 1)), axis=1)
        larger += int(np.count_nonzero(_of_counts(_cells(modes, drawn)) >= measured))
    return (1 + larger) / (1 + DRAWS) <= LEVEL


def _cells(modes: Array, cells: Integers) -> Array:
    """Episodes of each mode in each cell. Shape (draws, K, cells)."""
    return np.asarray(np.einsum("rk,drc->dkc", modes, np.eye(MOST_VALUES**2)[cells], optimize=True))


def _is_single(pair: _Pair, alone: Sequence[Integers], one: Array) -> bool:
    """Whether one column alone tells half of what the pair tells, beyond a guess."""
    guess = float(one.sum(axis=0).max())

    def told(values: Integers) -> float:
        counts = one.T @ np.eye(int(values.max()) + 1)[values]
        return float(counts.max(axis=0).sum()) - guess

    return max(map(told, alone), default=0.0) >= NEAR * told(pair.cell)
