"""The chunk to be expected of an observation, from episodes other than its own.

Comparable demonstrations are alike and not equal: a goal further left is gone to further left. So
what is expected of each is taken off before chunks are compared. The mean is smooth (kernel ridge
regression on landmarks; Williams and Seeger 2001), in a metric that a forest learned: an observed
number counts as much as it helps to predict. Every row's own episode, and those dealt to the same
fold, are left out of what is expected of it, so that no chunk is taken off itself.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.distance import cdist
from sklearn.linear_model import Ridge
from sklearn.utils.extmath import randomized_svd

from genpolicy.audit.data import Array, Integers

FOLDS = 5
LANDMARKS = 300
# Numbers that describe a chunk: its principal components, and of the variance they leave.
COMPONENTS = 12
# Widths of the kernel, of the median distance of rows, and strengths of the ridge.
WIDTHS = (0.3, 0.6, 1.2)
RIDGES = (1e-3, 1e-1)


@dataclass(frozen=True)
class Expected:
    """What is expected of rows, in principal components of the chunks.

    Attributes:
        pool: Of the rows that were learned from, each from other episodes. Shape (n, c).
        asked: Of the rows that were asked, from all. Shape (q, c).
        axes: The components. Shape (c, d).
    """

    pool: Array
    asked: Array
    axes: Array

    def shift(self, number: int, places: Integers) -> Array:
        """What takes chunks of the pool to where they are expected of a query. Shape (m, d)."""
        return np.asarray((self.asked[number] - self.pool[places]) @ self.axes)


def expected_chunks(
    known: Array,
    asked: Array,
    chunks: Array,
    *,
    episode: Integers,
    importance: Array,
    rng: np.random.Generator,
) -> Expected:
    """Cross-fitted means of chunks.

    Args:
        known: Inputs of the rows to learn from. Shape (n, f).
        asked: Inputs of the rows to ask. Shape (q, f).
        chunks: Chunks of the rows to learn from. Shape (n, d).
        episode: Episode of each. Shape (n,).
        importance: How much each input helps to predict. Shape (f,).
        rng: Generator of landmarks and folds.
    """
    spread = known.std(axis=0)
    weight = np.sqrt(importance) / np.where(spread > 0.0, spread, 1.0)
    known, asked = known * weight, asked * weight
    scores, axes = principal(chunks, rng)
    marks = known[_some(len(known), LANDMARKS, rng)]
    gaps, asked_gaps = cdist(known, marks, "sqeuclidean"), cdist(asked, marks, "sqeuclidean")
    usual = float(np.median(gaps)) or 1.0
    fold = _folds(episode, rng)
    best: tuple[float, Array, float, float] | None = None
    for width in WIDTHS:
        inputs = np.hstack([np.exp(-gaps / (2.0 * width**2 * usual)), known])
        for strength in RIDGES:
            out = np.empty_like(scores)
            for number in range(FOLDS):
                held = fold == number
                model = Ridge(alpha=strength).fit(inputs[~held], scores[~held])
                out[held] = model.predict(inputs[held])
            error = float(np.sum((scores - out) ** 2))
            if best is None or error < best[0]:
                best = error, out, width, strength
    assert best is not None
    _, out, width, strength = best
    inputs = np.hstack([np.exp(-gaps / (2.0 * width**2 * usual)), known])
    model = Ridge(alpha=strength).fit(inputs, scores)
    further = np.hstack([np.exp(-asked_gaps / (2.0 * width**2 * usual)), asked])
    return Expected(out, np.asarray(model.predict(further)), axes)


def principal(values: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """Scores of the first principal components, at most `COMPONENTS`, and their axes.

    Returns:
        Shapes (n, c) and (c, d).
    """
    centred = values - values.mean(axis=0)
    count = min(COMPONENTS, *centred.shape)
    _, _, axes = randomized_svd(centred, count, random_state=int(rng.integers(2**31)))
    return np.asarray(centred @ axes.T, dtype=np.float64), np.asarray(axes, dtype=np.float64)


def _folds(episode: Integers, rng: np.random.Generator) -> Integers:
    """Fold of each row, whole episodes together. Shape (n,)."""
    values, place = np.unique(episode, return_inverse=True)
    return np.asarray((rng.permutation(len(values)) % FOLDS)[place.reshape(-1)], dtype=np.int64)


def _some(count: int, most: int, rng: np.random.Generator) -> Integers:
    if count <= most:
        return np.arange(count)
    return np.asarray(np.sort(rng.choice(count, most, replace=False)), dtype=np.int64)
