"""Comparable demonstrations where nobody stands near: alike in what predicts the action.

In ten to forty observed numbers hardly two episodes agree in all of them, and most of them do not
matter. A forest of trees learns which do: each tree predicts the whole chunk from the observation
and its last step, and two rows that fall into one leaf are alike in what it split on. Source:
forest weights of Lin and Jeon 2006; kept apart as honest trees of Athey, Tibshirani and Wager 2019:
a tree is grown on half of the training episodes and its leaves are filled with those of the other
half, so that no chunk chooses its own neighbours, and none of a held-out episode is seen at all.

Of a situation the evidence can speak where two modes planted among its chunks would be found.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from sklearn.tree import ExtraTreeRegressor

from genpolicy.audit.data import Array, AuditInput, Integers, relative_paths
from genpolicy.audit.expected import Expected, expected_chunks, principal
from genpolicy.audit.modes import (
    ROUTE_CHUNKS,
    Clustering,
    cluster,
    cluster_chunks,
    features,
)
from genpolicy.audit.neighbourhoods import Neighbourhood, Support
from genpolicy.audit.progress import Progress, silent
from genpolicy.audit.rests import leaving, rank_of
from genpolicy.audit.settings import AuditSettings
from genpolicy.seeds import stream

TREES = 100
# Rows in a leaf; two rows that lie a chunk apart are nearly independent.
LEAF = 12
# Rows that the forest learns from, and situations that are looked at, at most.
POOL, QUERIES = 6000, 600
# Episodes that are compared: alike and not equal, more of them than of those who stand near.
NEIGHBOURS = 32
# Steps of a chunk that are predicted: its quarters.
QUARTERS = 4
# Modes that are planted lie so many times the least distance apart.
PLANTED = 2.0
# Pairs of chunks that their expected ones order by cluster: 7 right guesses of 10 order as many.
TOLD_ORDER = 0.75
# Share of the chunks that must be found on the side where they were planted.
FOUND = 0.9


@dataclass(frozen=True)
class Learned:
    """Situations of the learned evidence.

    Attributes:
        found: Phase, neighbours and clusters of those of which it can speak.
        support: How many were looked at, and which it cannot speak of, per phase.
        confirmed: Situations with modes by their neighbours that were asked again, and have them.
        contradicted: Those that have none, though modes as far apart as theirs would be found.
    """

    found: list[tuple[str, Neighbourhood, Clustering]]
    support: tuple[Support, ...]
    confirmed: int = 0
    contradicted: int = 0


@dataclass(frozen=True)
class Alike:
    """What the forest and the mean have learned of one phase.

    Attributes:
        pool: Rows that were learned from. Shape (n,).
        weights: How alike each query and each of them are. Shape (q, n).
        expected: What chunk is expected of each.
    """

    pool: Integers
    weights: Array
    expected: Expected


def find_learned(
    data: AuditInput,
    settings: AuditSettings,
    root_seed: int,
    *,
    again: Mapping[int, float] | None = None,
    progress: Progress = silent,
) -> Learned:
    """Situations by what predicts the action, of every group of `data.grouping`.

    Args:
        data: Canonical audit input.
        settings: Chunk length, what counts as modes.
        root_seed: Seed of the draws of rows, of the trees, and of what is planted.
        again: Held-out rows with modes by their neighbours, and how far those lie apart.
        progress: Called after every situation.
    """
    found: list[tuple[str, Neighbourhood, Clustering]] = []
    support: list[Support] = []
    groups, seen = np.unique(data.grouping), [0, 0]
    for phase in map(str, groups):
        pool, queries = _rows(data, settings, phase, root_seed, len(groups))
        asked_again = [row for row in sorted(again or {}) if data.grouping[row] == phase]
        if len(queries) == 0:
            continue
        if len(np.unique(data.episode[pool])) < 2 * settings.minimum_neighbours:
            support.append(Support(phase, len(queries), 0, tuple(queries.tolist())))
            continue
        rng = stream(root_seed, "audit", "forest", phase)
        rows = np.append(queries, np.asarray(asked_again, dtype=np.int64))
        alike = _learn(data, settings, pool, rows, rng)
        missed: list[int] = []
        for number, row in enumerate(rows.tolist()):
            other = number >= len(queries)
            apart = (again or {})[row] if other else PLANTED * settings.minimum_separation_m
            item, split = _asked(data, settings, alike, (number, row, apart), rng)
            if other:
                seen[0] += split is not None and split.count > 1
                seen[1] += split is not None and split.count == 1
            elif item is None or split is None:
                missed.append(row)
            else:
                found.append((phase, item, split))
            progress(f"situations of {phase} compared by what predicts", number + 1, len(rows))
        support.append(Support(phase, len(queries), len(queries) - len(missed), tuple(missed)))
    return Learned(found, tuple(support), *seen)


def _learn(
    data: AuditInput,
    settings: AuditSettings,
    pool: Integers,
    rows: Integers,
    rng: np.random.Generator,
) -> Alike:
    weights, importance = forest_weights(data, settings, pool, rows, rng)
    chunks = relative_paths(data, pool, ROUTE_CHUNKS * settings.chunk_rows)
    known, asked = (inputs(data, settings, part) for part in (pool, rows))
    flat = chunks.reshape(len(pool), -1)
    expected = expected_chunks(
        known, asked, flat, episode=data.episode[pool], importance=importance, rng=rng
    )
    return Alike(pool, weights, expected)


def _asked(
    data: AuditInput,
    settings: AuditSettings,
    alike: Alike,
    query: tuple[int, int, float],
    rng: np.random.Generator,
) -> tuple[Neighbourhood | None, Clustering | None]:
    """Neighbours of one query, and their clusters; None where nothing can be said.

    The query is its number, its row, and how far apart modes are planted to see what can be said.
    """
    number, row, apart = query
    near = _nearest(data, settings, alike.pool, alike.weights[number])
    if near is None:
        return None, None
    item = Neighbourhood(row, alike.pool[near], 1.0 / alike.weights[number][near])
    paths = relative_paths(data, item.members, ROUTE_CHUNKS * settings.chunk_rows)
    shift = alike.expected.shift(number, near).reshape(len(near), *paths.shape[1:])
    level = paths.copy()
    level[:-1] += shift
    split = cluster_chunks(level, settings)
    if split.count > 1:
        return item, split
    # Where the mean jumps, it is a poor one: then chunks as they are must fall into clusters that
    # what is expected of them does not tell.
    plain = cluster_chunks(paths, settings)
    if plain.count > 1 and not told_by_mean(paths[:-1], shift, plain.labels[:-1]):
        return item, plain
    vectors = features(level, settings)
    return item, split if planted_is_found(vectors, settings, apart, rng) else None


def told_by_mean(chunks: Array, shift: Array, labels: Integers) -> bool:
    """Whether what is expected of chunks orders their clusters: then the observation tells them.

    Args:
        chunks: Shape (n, S, P).
        shift: What takes each to where it is expected of the query. Shape (n, S, P).
        labels: Cluster of each. Shape (n,).
    """
    flat, expected = chunks.reshape(len(chunks), -1), -shift.reshape(len(chunks), -1)
    for mode in np.unique(labels):
        inside = labels == mode
        if inside.all():
            return False
        line = flat[inside].mean(axis=0) - flat[~inside].mean(axis=0)
        along = expected @ line
        pairs = along[inside][:, None] - along[~inside][None]
        if float(np.mean((pairs > 0) + 0.5 * (pairs == 0))) >= TOLD_ORDER:
            return True
    return False


def forest_weights(
    data: AuditInput,
    settings: AuditSettings,
    pool: Integers,
    queries: Integers,
    rng: np.random.Generator,
) -> tuple[Array, Array]:
    """How alike each query and each row of the pool are in what predicts the chunk.

    Returns:
        Weights, shape (q, n), and the predicted chunks of the queries, shape (q, d).
    """
    known, asked = inputs(data, settings, pool), inputs(data, settings, queries)
    chunks, _ = principal(targets(data, settings, pool), rng)
    episode = data.episode[pool]
    episodes = np.unique(episode)
    weights = np.zeros((len(queries), len(pool)))
    filled = np.zeros(len(pool))
    importance = np.zeros(known.shape[1])
    for _ in range(TREES):
        grown = np.isin(episode, rng.choice(episodes, len(episodes) // 2, replace=False))
        tree = ExtraTreeRegressor(
            min_samples_leaf=LEAF, max_features=1.0, random_state=int(rng.integers(2**31))
        )
        tree.fit(known[grown], chunks[grown])
        filling = np.flatnonzero(~grown)
        filled[filling] += 1.0
        importance += tree.feature_importances_
        _share(weights, tree.apply(asked), tree.apply(known[filling]), filling)
    return weights / np.maximum(filled, 1.0), importance / TREES


def inputs(data: AuditInput, settings: AuditSettings, rows: Integers) -> Array:
    """What a policy sees, in scales: the observation and its last step. Shape (n, d)."""
    used = np.flatnonzero(np.isfinite(data.observation_scale))
    scale = data.observation_scale[used]
    now = data.observation[np.ix_(rows, used)] / scale
    if settings.observation_horizon < 2:
        return np.asarray(now)
    before = np.maximum(rows - 1, data.first_row[rows])
    return np.concatenate([now, now - data.observation[np.ix_(before, used)] / scale], axis=1)


def targets(data: AuditInput, settings: AuditSettings, rows: Integers) -> Array:
    """The whole chunk at its quarters, in units of the least distance of modes. Shape (n, d)."""
    steps = settings.chunk_rows
    at = np.unique(np.linspace(steps / QUARTERS, steps, QUARTERS).astype(int)) - 1
    paths = relative_paths(data, rows, steps)[:, at]
    return np.asarray(paths.reshape(len(rows), -1) / settings.minimum_separation_m)


def planted_is_found(
    vectors: Array, settings: AuditSettings, apart: float, rng: np.random.Generator
) -> bool:
    """Whether two modes, planted among the chunks of one situation, would be found.

    The chunks are dealt to two sides at random and moved apart along a direction in which chunks
    of this situation differ. What is planted on wide or ragged chunks drowns.

    Args:
        vectors: Chunks of one situation. Shape (n, d).
        settings: What counts as modes.
        apart: How far from each other they are planted, unit of the vectors.
        rng: Generator of sides and direction.
    """
    count = len(vectors)
    sides = rng.permutation(np.arange(count) % 2)
    first, second = rng.choice(count, 2, replace=False)
    direction = vectors[first] - vectors[second]
    length = float(np.linalg.norm(direction))
    if length <= 0.0:
        direction, length = np.ones(vectors.shape[1]), float(np.sqrt(vectors.shape[1]))
    moved = vectors + (sides - 0.5)[:, None] * apart * direction / length
    split = cluster(moved, settings, settings.minimum_separation_m)
    if split.count < 2:
        return False
    same = max(float(np.mean((split.labels == 0) == (sides == side))) for side in (0, 1))
    return same >= FOUND


def _rows(
    data: AuditInput, settings: AuditSettings, phase: str, root_seed: int, groups: int
) -> tuple[Integers, Integers]:
    """Rows of training episodes to learn from, and held-out rows to ask, of one phase.

    Of a rest only the row from which the arm leaves: else its many equal rows, of which any may
    be taken for the neighbour, show how long it took and not where it goes.
    """
    rows = np.arange(len(data.episode))
    clean = ~data.episodes.is_recovery[data.episode] & (data.grouping == phase)
    clean &= data.last_row - rows >= settings.chunk_rows // 2
    leaves = leaving(data)
    clean &= leaves
    training = (data.episodes.split == "train")[data.episode]
    rng = stream(root_seed, "audit", "learned", phase)
    apart = max(1, settings.chunk_rows // QUARTERS)
    thinned = rank_of(data, leaves) % apart == 0
    pool = _some(rows[clean & training & thinned], POOL // groups, rng)
    return pool, _some(rows[clean & ~training], max(QUERIES // groups, 100), rng)


def _some(rows: Integers, most: int, rng: np.random.Generator) -> Integers:
    if len(rows) <= most:
        return np.asarray(rows, dtype=np.int64)
    return np.asarray(np.sort(rng.choice(rows, most, replace=False)), dtype=np.int64)


def _share(weights: Array, asked: Integers, leaves: Integers, filling: Integers) -> None:
    """Add to each query one weight, shared evenly by the rows of its leaf; in place."""
    order = np.argsort(leaves, kind="stable")
    ordered = leaves[order]
    first, last = (np.searchsorted(ordered, asked, side) for side in ("left", "right"))
    for number, (begin, end) in enumerate(zip(first, last, strict=True)):
        if end > begin:
            weights[number, filling[order[begin:end]]] += 1.0 / (end - begin)


def _nearest(
    data: AuditInput, settings: AuditSettings, pool: Integers, weight: Array
) -> Integers | None:
    """The row most alike of each episode, the most alike episodes first; None where too few."""
    order = np.argsort(-weight, kind="stable")
    order = order[weight[order] > 0.0]
    _, first = np.unique(data.episode[pool[order]], return_index=True)
    chosen = order[np.sort(first)[:NEIGHBOURS]]
    if len(chosen) < settings.minimum_neighbours:
        return None
    return chosen
