"""Situations: a held-out row and the training episodes that stood in (nearly) the same place.

Neighbours come from training episodes only and at most one row per episode, so they are
independent demonstrations of one observation. Ties are broken by a named random stream. Where
too few lie inside the radius, nothing is claimed and the situation is counted as unsupported.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from genpolicy.audit.data import Array, AuditInput, Integers, observation_history
from genpolicy.audit.settings import AuditSettings
from genpolicy.seeds import stream

CANDIDATES_PER_NEIGHBOUR = 6


@dataclass(frozen=True)
class Neighbourhood:
    """One analysed situation.

    Attributes:
        query: Row of the held-out episode.
        rows: Rows of the neighbours, nearest first, one per training episode. Shape (n,).
        distance: Their distances in units of the scales. Shape (n,).
    """

    query: int
    rows: Integers
    distance: Array

    @property
    def members(self) -> Integers:
        """Neighbours and, last, the query. Shape (n + 1,)."""
        return np.append(self.rows, self.query)


@dataclass(frozen=True)
class Support:
    """How far the training data reach.

    Attributes:
        phase: Task phase.
        queries: Queries made.
        analysed: Of them with enough neighbours.
        missed: Rows of the others.
    """

    phase: str
    queries: int
    analysed: int
    missed: tuple[int, ...] = ()


def find(
    data: AuditInput, settings: AuditSettings, *, phase: str, root_seed: int
) -> tuple[list[Neighbourhood], Support]:
    """All situations of one phase in canonical data.

    Args:
        data: Canonical audit input.
        settings: Neighbours, radius, stride.
        phase: The phase, or `any` where the policy does not see it; neighbours are of the same.
        root_seed: Seed of ties and of the draw of queries.

    Returns:
        The analysed situations in order of the query row, and the support.
    """
    clean = ~data.episodes.is_recovery[data.episode] & (data.grouping == phase)
    training = (data.episodes.split == "train")[data.episode]
    pool = np.flatnonzero(clean & training)
    queries = _queries(data, settings, np.flatnonzero(clean & ~training), phase, root_seed)
    if len(pool) == 0 or len(queries) == 0:
        return [], Support(phase, len(queries), 0, tuple(queries.tolist()))
    pool = stream(root_seed, "audit", "ties", phase).permutation(pool)
    tree = cKDTree(observation_history(data, pool, settings.observation_horizon))
    points = observation_history(data, queries, settings.observation_horizon)
    found: list[Neighbourhood | None] = [None] * len(queries)
    pending, k = np.arange(len(queries)), settings.neighbours * CANDIDATES_PER_NEIGHBOUR
    while len(pending):
        k = min(k, len(pool))
        distance, place = tree.query(
            points[pending], k=np.arange(1, k + 1), distance_upper_bound=settings.radius
        )
        again = []
        for number, gaps, hits in zip(
            pending, np.asarray(distance), np.asarray(place), strict=True
        ):
            inside = np.isfinite(gaps)
            result = _nearest(data, pool[hits[inside]], gaps[inside], settings.neighbours)
            exhausted = k == len(pool) or not inside.all()
            if len(result[0]) < settings.neighbours and not exhausted:
                again.append(number)
            elif len(result[0]) >= settings.minimum_neighbours:
                found[number] = Neighbourhood(int(queries[number]), *result)
        pending, k = np.asarray(again, dtype=np.int64), k * 4
    kept = [item for item in found if item is not None]
    missed = tuple(int(q) for q, item in zip(queries, found, strict=True) if item is None)
    return kept, Support(phase, len(queries), len(kept), missed)


def _nearest(
    data: AuditInput, rows: Integers, distance: Array, count: int
) -> tuple[Integers, Array]:
    """The nearest row of each episode, nearest episodes first; equal distances keep pool order."""
    order = np.argsort(np.round(distance, 9), kind="stable")
    _, first = np.unique(data.episode[rows[order]], return_index=True)
    chosen = order[np.sort(first)[:count]]
    return rows[chosen], distance[chosen]


def _queries(
    data: AuditInput, settings: AuditSettings, rows: Integers, phase: str, root_seed: int
) -> Integers:
    """Every n-th row of each held-out episode's phase with half a chunk left; capped at random."""
    rows = rows[data.last_row[rows] - rows >= settings.chunk_rows // 2]
    _, start = np.unique(data.episode[rows], return_index=True)
    rank = np.arange(len(rows)) - np.repeat(start, np.diff(np.append(start, len(rows))))
    rows = rows[rank % settings.query_stride == 0]
    if len(rows) > settings.maximum_queries_per_phase:
        draw = stream(root_seed, "audit", "queries", phase)
        rows = np.sort(draw.choice(rows, settings.maximum_queries_per_phase, replace=False))
    return np.asarray(rows, dtype=np.int64)
