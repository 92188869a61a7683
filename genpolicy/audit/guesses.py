"""Guesses at the mode of an episode from what others with a like value chose; never from its own.

Each takes the folds and answers with a score of every mode: how well what is known of the episode
fits the training episodes of that mode. Training episodes count with the weights of their choices,
so that a frequent mode is no better guess than a rare one.
"""

from collections.abc import Callable

import numpy as np
from sklearn.tree import DecisionTreeClassifier

from genpolicy.audit.choices import Choices
from genpolicy.audit.data import Array, Flags, Integers, Text

FOLDS = 10
DEPTH, LEAF_SHARE = 4, 0.05  # of the tree; leaves hold that share of the episodes
FLAT = 1e-9  # least spread of a column inside the modes; a cue without error has none
Guess = Callable[[Choices, Flags, int], Array]
"""Scores of the held-out episodes: choices, which of them are held out, seed -> (held out, K)."""


def by_value(values: Integers | Text) -> Guess:
    """Where the value was seen: how often, in each mode. Shape of `values`: (n,)."""
    codes = np.unique(values, return_inverse=True)[1].reshape(-1)

    def guess(choices: Choices, held: Flags, seed: int) -> Array:
        known = ~held
        table = np.zeros((int(codes.max()) + 1, choices.share.shape[1]))
        np.add.at(table, (codes[known], choices.mode[known]), choices.weight[known])
        return np.asarray(table[codes[held]] / _mass(table))

    return guess


def by_nearest(place: Array, count: int) -> Guess:
    """The modes of the `count` training episodes nearest in `place`. Shape of `place`: (n,)."""

    def guess(choices: Choices, held: Flags, seed: int) -> Array:
        known = np.flatnonzero(~held)
        one = np.zeros((len(known), choices.share.shape[1]))
        one[np.arange(len(known)), choices.mode[known]] = choices.weight[known]
        gaps = np.abs(place[held][:, None] - place[known][None])
        nearest = np.argsort(gaps, axis=1, kind="stable")[:, :count]
        return np.asarray(one[nearest].sum(axis=1) / _mass(one))

    return guess


def by_best_column(values: Array) -> Guess:
    """Nearer middle of the one column that orders the training episodes best by mode.

    Args:
        values: Shape (n, F).
    """

    def guess(choices: Choices, held: Flags, seed: int) -> Array:
        known, kinds = ~held, choices.share.shape[1]
        weight, mode = choices.weight[known], choices.mode[known]
        part = values[known]
        spread = part.std(axis=0)
        part = (part - part.mean(axis=0)) / np.where(spread > 0.0, spread, 1.0)
        one = (mode[:, None] == np.arange(kinds)) * weight[:, None]
        mass = one.sum(axis=0)
        middles = (one.T @ part) / np.maximum(mass, 1e-12)[:, None]
        mean = (weight @ part) / weight.sum()
        between = mass @ (middles - mean) ** 2
        best = int(np.argmax(np.where(spread > 0.0, between, -1.0)))
        centred = (values[held][:, best] - values[known][:, best].mean()) / max(
            float(spread[best]), 1e-12
        )
        score = -np.abs(centred[:, None] - middles[None, :, best])
        return np.where(mass > 0.0, score, -np.inf)

    return guess


def by_one_more(base: Array, values: Array) -> Guess:
    """The best column of `base` and the one of `values` that orders best what that one leaves.

    A linear discriminant of the two, without priors: of the second column what follows from the
    first inside the modes is taken away. Source: Fisher 1936.

    Args:
        base: Shape (n, B).
        values: Shape (n, F).
    """

    def guess(choices: Choices, held: Flags, seed: int) -> Array:
        known, kinds = ~held, choices.share.shape[1]
        weight, mode = choices.weight[known], choices.mode[known]
        one = (mode[:, None] == np.arange(kinds)) * weight[:, None]
        mass = one.sum(axis=0)

        def middles(part: Array) -> Array:
            return np.asarray((one.T @ part) / np.maximum(mass, 1e-12)[:, None])

        def within(part: Array, other: Array) -> Array:
            rest, more = part - middles(part)[mode], other - middles(other)[mode]
            return np.asarray(weight @ (rest * more) / weight.sum())

        def between(part: Array) -> Array:
            return np.asarray(mass @ (middles(part) - weight @ part / weight.sum()) ** 2)

        def ordered(part: Array) -> tuple[int, Array]:
            spread = np.maximum(within(part, part), FLAT)
            gain = between(part) / spread
            return int(np.argmax(np.where(part.std(axis=0) > 0.0, gain, -1.0))), spread

        def distance(part: Array, spread: float) -> Array:
            return np.asarray(
                (part[held][:, None] - middles(part[known, None])[:, 0]) ** 2 / spread
            )

        first, spread = ordered(base[known])
        seen = base[:, first]
        slope = within(values[known], seen[known, None]) / spread[first]
        left = values - seen[:, None] * slope
        second, spreads = ordered(left[known])
        score = -distance(seen, float(spread[first])) - distance(
            left[:, second], float(spreads[second])
        )
        return np.where(mass > 0.0, score, -np.inf)

    return guess


def _mass(table: Array) -> Array:
    """Weight of each mode among the training episodes, so that to be left out tells nothing."""
    return np.asarray(np.maximum(table.sum(axis=0), 1e-12))


def by_all(values: Array) -> Guess:
    """A small tree over all columns at once. Source: Breiman et al. 1984, CART.

    Args:
        values: Shape (n, F).
    """

    def guess(choices: Choices, held: Flags, seed: int) -> Array:
        tree = DecisionTreeClassifier(
            max_depth=DEPTH, min_samples_leaf=LEAF_SHARE, random_state=seed
        )
        tree.fit(values[~held], choices.mode[~held], sample_weight=choices.weight[~held])
        result = np.zeros((int(np.count_nonzero(held)), choices.share.shape[1]))
        result[:, tree.classes_] = tree.predict_proba(values[held])
        return result

    return guess


def right(choices: Choices, guess: Guess, rng: np.random.Generator, *, repeats: int) -> Array:
    """How often each episode's mode is guessed while it is held out; ties share. Shape (n,)."""
    n = len(choices.mode)
    result = np.zeros(n)
    for _ in range(repeats):
        fold = rng.permutation(n) % min(FOLDS, n)
        seed = int(rng.integers(2**31))
        for number in range(int(fold.max()) + 1):
            held = fold == number
            scores = np.where(choices.allowed[held], guess(choices, held, seed), -np.inf)
            best = scores >= scores.max(axis=1, keepdims=True) - 1e-9
            best &= choices.allowed[held]
            own = best[np.arange(len(best)), choices.mode[held]]
            result[held] += own / np.maximum(best.sum(axis=1), 1)
    return result / repeats
