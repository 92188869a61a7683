"""Modes: clusters of whole chunks that two independent opinions agree on.

First opinion: the best split into two or three along a principal axis must gain over one
component under the integrated classification likelihood (Biernacki, Celeux and Govaert 2000),
which a single Gaussian and a uniform cloud both fail. Second opinion: HDBSCAN (Campello et al.
2013) must find the same split; alone it is not enough, since it calls a cloud without structure
noise. On top, the centres must lie further apart than a length that matters, and each group must
have enough members.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.ndimage import uniform_filter1d
from sklearn import config_context
from sklearn.cluster import HDBSCAN

from genpolicy.audit.data import Array, Integers
from genpolicy.audit.middle import middle
from genpolicy.audit.settings import AuditSettings

AXES = 3
AGREEMENT = 0.9
MAXIMUM_DEPTH = 2
MINIMUM_SAMPLES = 2
# Chunks whose rows are looked at for one chunk's route: the chunk and what follows it.
ROUTE_CHUNKS = 2
# Share of a chunk over which its length is smoothed; order and noise gain of third differences.
SMOOTHING_SHARE = 4
THIRD, THIRD_POWER = 3, 20.0
# A step below this share of the usual one is none: the arm stands.
STANDS = 0.1


@dataclass(frozen=True)
class Clustering:
    """Modes of one set of chunks.

    Attributes:
        labels: Mode of each chunk, 0 the largest. Shape (n,).
        separation: Smallest RMS distance between two centres, unit of the paths; 0 for one mode.
        medoids: Chunk nearest to all of its mode, one per mode.
    """

    labels: Integers
    separation: float
    medoids: tuple[int, ...]

    @property
    def count(self) -> int:
        """Number of modes, at least 1."""
        return len(self.medoids)

    @property
    def sizes(self) -> tuple[int, ...]:
        """Members per mode."""
        return tuple(int(size) for size in np.bincount(self.labels, minlength=self.count))


def features(paths: Array, settings: AuditSettings, like: Array | None = None) -> Array:
    """Vectors whose Euclidean distance is the RMS distance of two chunks.

    Args:
        paths: Positions of chunks from a common origin, and what follows them. Shape (n, S, P).
        settings: `representation`: `path` resamples at equal arc length, so that fast and slow
            along one route are one mode; `time` compares position by position.
        like: Chunks whose common length and tremor are taken, to hold others against them; those
            of `paths` where None. Shape (m, S, P).

    Returns:
        Shape (n, min(K, S) * P).
    """
    n, steps = len(paths), min(settings.chunk_rows, paths.shape[1])
    used = paths[:, :steps]
    if settings.representation == "path":
        used = _by_arc_length(paths, steps, like)
    return np.asarray(used.reshape(n, -1) / np.sqrt(steps), dtype=np.float64)


def cluster_chunks(paths: Array, settings: AuditSettings) -> Clustering:
    """Modes of chunks from one situation.

    Args:
        paths: Positions relative to the TCP of their own observation, `ROUTE_CHUNKS` chunks long
            where what follows is known. Shape (n, S, P).
        settings: Sizes, separation, representation.

    Returns:
        The modes; a single one unless both opinions agree on more.
    """
    return cluster(features(paths, settings), settings, settings.minimum_separation_m)


def cluster(vectors: Array, settings: AuditSettings, separation: float) -> Clustering:
    """Modes of chunks given as vectors.

    Args:
        vectors: Euclidean distances between them are RMS distances of chunks. Shape (n, d).
        settings: Sizes and gain.
        separation: Modes nearer than this are one, unit of the vectors.

    Returns:
        The modes; a single one unless both opinions agree on more.
    """
    labels = np.zeros(len(vectors), dtype=np.int64)
    _bisect(vectors, np.arange(len(vectors)), labels, settings, separation=separation)
    gaps = distances(vectors)
    if not labels.any():
        return Clustering(labels, 0.0, (int(np.argmin(gaps.sum(axis=1))),))
    labels = by_size(labels)
    medoids = tuple(
        _medoid(gaps, np.flatnonzero(labels == mode)) for mode in range(int(labels.max()) + 1)
    )
    return Clustering(labels=labels, separation=_separation(vectors, labels), medoids=medoids)


def distances(vectors: Array) -> Array:
    """Euclidean distances of all pairs. Shape (n, n)."""
    centred = vectors - vectors.mean(axis=0)
    products = centred @ centred.T
    squares = np.diagonal(products)
    gaps = np.sqrt(np.maximum(squares[:, None] + squares[None] - 2.0 * products, 0.0))
    np.fill_diagonal(gaps, 0.0)
    return np.asarray(gaps, dtype=np.float64)


def split_gain(values: Array, least: int, groups: int = 2) -> tuple[float, Integers]:
    """Best split of one-dimensional values into components of equal spread.

    Args:
        values: Shape (n,).
        least: Smallest size of a group.
        groups: Number of components, 2 or 3.

    Returns:
        Gain of `groups` components over one (> 0: better), and the group of each value. Shape
        (n,).
    """
    n = len(values)
    order = np.argsort(values, kind="stable")
    x = values[order] - values.mean()
    cuts = _cuts(n, least, groups)
    if len(cuts) == 0:
        return -np.inf, np.zeros(n, dtype=np.int64)
    edges = np.hstack([np.zeros((len(cuts), 1), dtype=np.int64), cuts, np.full((len(cuts), 1), n)])
    total, squares = np.append(0.0, np.cumsum(x)), np.append(0.0, np.cumsum(x * x))
    sizes = np.diff(edges, axis=1)
    within = squares[-1] - np.sum(np.diff(total[edges], axis=1) ** 2 / sizes, axis=1)
    best = int(np.argmin(within))
    floor = 1e-12 * float(squares[-1]) + 1e-300
    share = sizes[best] / n
    gain = n * np.log((squares[-1] + floor) / (max(float(within[best]), 0.0) + floor))
    gain += 2 * n * float(np.sum(share * np.log(share))) - 2 * (groups - 1) * np.log(n)
    sides = np.empty(n, dtype=np.int64)
    sides[order] = np.searchsorted(cuts[best], np.arange(n), side="right")
    return float(gain), sides


@lru_cache(maxsize=256)
def _cuts(n: int, least: int, groups: int) -> Integers:
    """All places to cut n sorted values into groups of at least `least`. Shape (c, groups - 1)."""
    first = np.arange(least, n - (groups - 1) * least + 1, dtype=np.int64)
    if groups == 2:
        return first[:, None]
    a, b = np.meshgrid(first, np.arange(2 * least, n - least + 1, dtype=np.int64), indexing="ij")
    keep = b - a >= least
    return np.stack([a[keep], b[keep]], axis=1)


def reach(vectors: Array, least: int) -> float:
    """Furthest that the centres of two groups, each of `least` or more, can lie apart."""
    share = min(0.5, least / len(vectors))
    return float(np.sqrt(vectors.var(axis=0).sum() / (share * (1.0 - share))))


def _bisect(
    vectors: Array,
    rows: Integers,
    labels: Integers,
    settings: AuditSettings,
    *,
    separation: float,
    depth: int = 0,
) -> None:
    """Split `rows` while both opinions agree; writes new labels in place."""
    least = smallest(settings, len(labels))
    if depth == MAXIMUM_DEPTH or len(rows) < 2 * least:
        return
    part = vectors[rows]
    if reach(part, least) < separation:  # no split of this spread can be that far apart
        return
    sides = next(
        (
            split
            for split in _principal_splits(part, least, settings.minimum_gain)
            if _separation(part, split) >= separation and _confirmed(part, split, least)
        ),
        None,
    )
    if sides is None:
        return
    for side in range(1, int(sides.max()) + 1):
        labels[rows[sides == side]] = labels.max() + 1
    for side in range(int(sides.max()) + 1):
        _bisect(
            vectors, rows[sides == side], labels, settings, separation=separation, depth=depth + 1
        )


def smallest(settings: AuditSettings, members: int) -> int:
    """Smallest size of a mode among `members` chunks."""
    return max(settings.minimum_mode_size, int(np.ceil(settings.minimum_mode_share * members)))


def _principal_splits(vectors: Array, least: int, minimum_gain: float) -> list[Integers]:
    """Splits along the principal axes that gain enough, best first."""
    centred = vectors - vectors.mean(axis=0)
    values, axes = np.linalg.eigh(centred @ centred.T)
    found: list[tuple[float, Integers]] = []
    for number in range(1, 1 + min(AXES, len(values))):
        if values[-number] <= 0.0:
            break
        # The sign of an eigenvector is arbitrary: fix it, so that equal data give equal labels.
        axis = axes[:, -number] * np.sign(axes[np.argmax(np.abs(axes[:, -number])), -number])
        for groups in (2, 3):
            gain, sides = split_gain(axis * np.sqrt(values[-number]), least, groups)
            if gain > minimum_gain:
                found.append((gain, sides))
    return [sides for _, sides in sorted(found, key=lambda item: -item[0])]


def _confirmed(vectors: Array, sides: Integers, least: int) -> bool:
    """Whether HDBSCAN finds clusters in every group and none that mixes them."""
    with config_context(assume_finite=True, skip_parameter_validation=True):
        found = HDBSCAN(
            min_cluster_size=least, min_samples=MINIMUM_SAMPLES, algorithm="brute", copy=True
        ).fit_predict(vectors)
    clear = found >= 0
    if np.count_nonzero(clear) < len(vectors) / 2:
        return False
    pure, majorities = 0, set()
    for cluster in np.unique(found[clear]):
        counts = np.bincount(sides[found == cluster])
        pure += int(counts.max())
        majorities.add(int(counts.argmax()))
    return majorities == set(sides.tolist()) and bool(pure >= AGREEMENT * np.count_nonzero(clear))


def _by_arc_length(paths: Array, steps: int, like: Array | None) -> Array:
    """Paths resampled at equal arc lengths up to one that most of them reach within `steps`.

    Whoever still rests when the chunk begins goes the same way a little later: what follows the
    chunk counts until the common length is reached, so that to wait is no route of its own. Nor
    does it make the length shorter, on which two ways could not part: the steps are counted from
    where the arm leaves. The length begins where the path does, at the origin, not at the first
    command: what lies between them is lag times speed, and a faster one would seem to go another
    way.
    """
    n, width = len(paths), max(1, steps // SMOOTHING_SHARE)
    paths = np.concatenate([np.zeros_like(paths[:, :1]), paths], axis=1)
    if like is None:
        along = progress(paths, width)
        common = _common_length(along, steps)
    else:
        like = np.concatenate([np.zeros_like(like[:, :1]), like], axis=1)
        common = _common_length(progress(like, width), steps)
        along = progress(paths, width, like)
    at = np.broadcast_to(np.linspace(0.0, common, steps), (n, steps))
    left = np.sum(along[:, None, 1:-1] <= at[:, :, None], axis=2)
    rows = np.arange(n)[:, None]
    gap = along[rows, left + 1] - along[rows, left]
    share = np.clip((at - along[rows, left]) / np.where(gap > 0.0, gap, 1.0), 0.0, 1.0)[..., None]
    return np.asarray((1.0 - share) * paths[rows, left] + share * paths[rows, left + 1])


def _common_length(along: Array, steps: int) -> float:
    """Length that most paths reach within `steps` from where they leave."""
    ends = np.minimum(_leaves(along) + steps, along.shape[1] - 1)
    lengths = along[np.arange(len(along)), ends]
    return max(float(np.quantile(lengths, 0.25)), 0.5 * float(middle(lengths)))


def _leaves(along: Array) -> Integers:
    """Step after which each path leaves where it stands; 0 where it goes at once. Shape (n,)."""
    step = np.diff(along, axis=1)
    moving = step[step > 0.0]
    if not len(moving):
        return np.zeros(len(along), dtype=np.int64)
    goes = step >= STANDS * float(middle(moving))
    return np.where(goes.any(axis=1), np.argmax(goes, axis=1), 0)


def progress(paths: Array, width: int, like: Array | None = None) -> Array:
    """How far each path has come at each step, tremor left out. Shape (n, S).

    The length of a path that trembles grows while it stands. So it is taken from running means,
    less the square that white noise adds to a step; the noise is read off third differences, in
    which a smooth motion is next to nothing, of the paths in `like`, else of these.
    """
    smooth = uniform_filter1d(paths, width, axis=1, mode="nearest")
    squares = np.sum(np.diff(smooth, axis=1) ** 2, axis=2)
    if paths.shape[1] > THIRD:
        rough = paths if like is None else like
        third = np.sum(np.diff(rough, THIRD, axis=1) ** 2, axis=2) / THIRD_POWER
        squares = np.maximum(squares - 2.0 * middle(third.reshape(-1)) / width**2, 0.0)
    along = np.zeros(paths.shape[:2])
    along[:, 1:] = np.cumsum(np.sqrt(squares), axis=1)
    return along


def _separation(vectors: Array, labels: Integers) -> float:
    centres = np.stack([vectors[labels == mode].mean(axis=0) for mode in np.unique(labels)])
    if len(centres) < 2:
        return 0.0
    gaps = np.linalg.norm(centres[:, None] - centres[None], axis=2)
    return float(gaps[np.triu_indices(len(centres), 1)].min())


def _medoid(gaps: Array, members: Integers) -> int:
    return int(members[np.argmin(gaps[np.ix_(members, members)].sum(axis=1))])


def by_size(labels: Integers) -> Integers:
    """Labels renumbered: 0 the largest; of equals, the one that appears first."""
    values, first, codes, counts = np.unique(
        labels, return_index=True, return_inverse=True, return_counts=True
    )
    order = np.lexsort((first, -counts))
    rank = np.empty(len(values), dtype=np.int64)
    rank[order] = np.arange(len(values))
    return np.asarray(rank[codes.reshape(-1)], dtype=np.int64)
