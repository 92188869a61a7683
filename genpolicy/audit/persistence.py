"""Persistence: a mode keeps its episodes together over time, noise deals them anew.

The clusters of a situation are looked up again a chunk later, when not one action is shared:
each episode should then lie nearer to the others of its own cluster than to the other cluster.
The null deals the later chunks at random among the episodes (the link over time is shuffled).

A grip or a start is one event, gone a chunk later. So clusters of other components than the route
are made of every other action, and looked up in those between, none of which they have seen.
"""

import numpy as np

from genpolicy.audit.components import Component, joined, series
from genpolicy.audit.data import Array, AuditInput, Integers, relative_paths
from genpolicy.audit.documents import Persistence
from genpolicy.audit.modes import ROUTE_CHUNKS, Clustering, cluster, features
from genpolicy.audit.neighbourhoods import Neighbourhood
from genpolicy.audit.settings import AuditSettings

NULL_QUANTILE = 0.95
MINIMUM_PER_MODE = 2
DRAWS = 99


def kept_identity(
    data: AuditInput,
    settings: AuditSettings,
    situation: Neighbourhood,
    clustering: Clustering,
    *,
    rng: np.random.Generator,
) -> tuple[float, Array] | None:
    """Share of episodes whose later chunk still belongs to their cluster, and its null.

    Returns:
        Share and null draws, shape (99,); None where too few episodes go on that long.
    """
    members = situation.members
    later = members + settings.persistence_lag_rows
    alive = later + settings.chunk_rows // 2 <= data.last_row[members]
    labels = clustering.labels[alive]
    counts = np.bincount(labels, minlength=clustering.count)
    if np.count_nonzero(counts >= MINIMUM_PER_MODE) < 2:
        return None
    paths = relative_paths(data, later[alive], ROUTE_CHUNKS * settings.chunk_rows)
    return _against_null(features(paths, settings), labels, rng)


def kept_between(
    data: AuditInput,
    settings: AuditSettings,
    component: Component,
    situation: Neighbourhood,
    *,
    rng: np.random.Generator,
) -> tuple[float, Array]:
    """Share of episodes that clusters of every other action find again in those between.

    Returns:
        Share and null draws, shape (99,); zeros where every other action has no clusters.
    """
    values = series(data, settings, component, situation.members)
    labels = cluster(joined(component, values[:, ::2]), settings, component.separation).labels
    if labels.max() == 0:
        return 0.0, np.zeros(DRAWS)
    return _against_null(joined(component, values[:, 1::2]), labels, rng)


def _against_null(
    vectors: Array, labels: Integers, rng: np.random.Generator
) -> tuple[float, Array]:
    gaps = np.linalg.norm(vectors[:, None] - vectors[None], axis=2)
    dealt = [rng.permutation(labels) for _ in range(DRAWS)]
    observed, *null = shares(gaps, np.stack([labels, *dealt]))
    return float(observed), np.asarray(null)


def summarise(measured: list[tuple[float, Array] | None]) -> Persistence:
    """Mean over the situations against the mean of their nulls."""
    known = [item for item in measured if item is not None]
    if not known:
        return Persistence(0.0, 1.0, 1.0, 0)
    null = np.mean([item[1] for item in known], axis=0)
    return Persistence(
        observed=float(np.mean([item[0] for item in known])),
        null_q95=float(np.quantile(null, NULL_QUANTILE)),
        null_mean=float(null.mean()),
        n=len(known),
    )


def persistent(measured: tuple[float, Array] | None) -> bool:
    """Whether one situation keeps its identity beyond its own null."""
    return measured is not None and measured[0] > float(np.quantile(measured[1], NULL_QUANTILE))


def shares(gaps: Array, labels: Integers) -> Array:
    """Share of chunks nearer on average to their own cluster (itself left out) than to others.

    Args:
        gaps: Distances of all pairs. Shape (n, n).
        labels: Cluster of each chunk, the same sizes in every row. Shape (m, n).

    Returns:
        Shape (m,).
    """
    kinds = np.unique(labels)
    own = labels[:, :, None] == kinds
    counts = own.sum(axis=1)[:, None] - own
    means = np.matmul(gaps, own.astype(np.float64)) / np.maximum(counts, 1)
    means[counts == 0] = np.inf
    return np.asarray(np.mean(kinds[np.argmin(means, axis=2)] == labels, axis=1))


def roughness(values: Array) -> float:
    """Von Neumann ratio of the spread, constant differences counted as smooth: 1 is white noise.

    Args:
        values: Shape (n, S, d).
    """
    residual = values - values.mean(axis=0)
    power = float(np.mean(residual**2))
    return float(np.mean(np.diff(residual, axis=1) ** 2)) / (2.0 * power) if power > 0.0 else 0.0


def von_neumann(paths: Array) -> tuple[float, float]:
    """Von Neumann ratio of the residual along the chunk (1 white, 0 smooth), and its RMS."""
    residual = paths - paths.mean(axis=0)
    residual = residual - residual.mean(axis=1, keepdims=True)
    power = float(np.mean(residual**2))
    if power <= 0.0:
        return 0.0, 0.0
    steps = float(np.mean(np.diff(residual, axis=1) ** 2))
    return steps / (2.0 * power), float(np.sqrt(power * paths.shape[2]))
