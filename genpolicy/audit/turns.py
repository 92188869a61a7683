"""Do modes follow from those of the episodes before and after, whatever they are called?

Who is told a side per session keeps it at every start. But the modes of one start have no names in
common with those of another, so that a mode nearby says nothing by its name. Here every mode gets a
number, the same sum of squares in all of them, such that episodes near each other have numbers as
alike as can be (or as opposite, where sides alternate): the largest Moran coefficient over all
ways to number the modes, held against its distribution where modes are dealt anew inside
situations. Source: Moran 1950; largest eigenvalue: Tiefelsdorf and Griffith 2007.
"""

from dataclasses import dataclass

import numpy as np

from genpolicy.audit.data import Array, Integers

# Weight of episodes so many places apart: a session keeps its side, turns alternate.
KERNELS = ((4.0, 3.0, 2.0, 1.0), (-4.0, 3.0, -2.0, 1.0))
# A first look that stops where nothing is to be seen; it makes no false finding more likely.
FIRST_LOOK, GO_ON = 199, 0.05
FLAT = 1e-9


@dataclass(frozen=True)
class Pattern:
    """Whether modes follow a pattern along a sequence.

    Attributes:
        p_value: Permutation p-value of the clearest pattern.
        guessed: Mode of each row's situation that its neighbours in the sequence speak for, of
            numbers that were found without it. Shape (n,).
        by_nearest: The same of the nearest neighbours alone; -1 where there are none. Shape (n,).
    """

    p_value: float
    guessed: Integers
    by_nearest: Integers


def pattern(
    place: Array, modes: Integers, cell: Integers, *, rng: np.random.Generator, draws: int
) -> Pattern:
    """The clearest pattern of modes along a sequence, inside cells.

    Args:
        place: Place of each row's episode in the sequence, whole numbers, each once. Shape (n,).
        modes: Mode of each, of names that hold wherever they were linked. Shape (n,).
        cell: Rows among which modes are exchangeable. Shape (n,).
        rng: Generator of the draws.
        draws: Draws, from which the smallest p-value follows.
    """
    order = np.argsort(place, kind="stable")
    place, cell = place[order], _numbered(cell[order])
    names, modes = np.unique(modes[order], return_inverse=True)
    modes = np.asarray(modes.reshape(-1), dtype=np.int64)
    scored, whitened = _basis(modes, cell)
    guesses = np.full((2, len(modes)), -1, dtype=np.int64)
    p_value = 1.0
    if scored.shape[1]:
        near = [_near(place, kernel) for kernel in KERNELS]
        p_value = _p_value(scored, near, cell, rng, min(FIRST_LOOK, draws))
        if p_value <= GO_ON and draws > FIRST_LOOK:
            p_value = _p_value(scored, near, cell, rng, draws)
        guesses = _guesses(scored, near, (modes, cell, whitened))
    result = np.empty_like(guesses)
    result[:, order] = np.where(guesses >= 0, names[guesses], -1)
    return Pattern(p_value, result[0], result[1])


def _basis(modes: Integers, cell: Integers) -> tuple[Array, Array]:
    """Orthonormal numbers of the modes, centred in their cells, and how a mode is numbered.

    Returns:
        Of each row, shape (n, r), and what takes indicators of modes to them, shape (K, r).
    """
    one = np.eye(int(modes.max(initial=-1)) + 1)[modes]
    centred = one - _means(one, cell)
    values, axes = np.linalg.eigh(centred.T @ centred)
    kept = values > FLAT * max(len(modes), 1)
    whitened = axes[:, kept] / np.sqrt(values[kept])
    return centred @ whitened, whitened


def _means(values: Array, cell: Integers) -> Array:
    """Mean of the cell of each row. Shape as `values`."""
    sums = np.zeros((int(cell.max(initial=-1)) + 1, values.shape[1]))
    np.add.at(sums, cell, values)
    return np.asarray((sums / np.bincount(cell)[:, None])[cell])


def _near(place: Array, kernel: tuple[float, ...]) -> list[tuple[Integers, Integers, float]]:
    """Pairs of rows so many places apart, with their weight."""
    found = []
    at = {int(p): k for k, p in enumerate(place)}
    for lag, weight in enumerate(kernel, start=1):
        pairs = [(k, at[int(p) + lag]) for k, p in enumerate(place) if int(p) + lag in at]
        first, second = np.array(pairs, dtype=np.int64).reshape(-1, 2).T
        found.append((first, second, weight))
    return found


def _moran(scored: Array, near: list[tuple[Integers, Integers, float]]) -> Array:
    """Likeness of neighbours by pair of numbers. Shape (..., r, r) of scores (..., n, r)."""
    total = sum(
        weight * np.swapaxes(scored[..., first, :], -1, -2) @ scored[..., second, :]
        for first, second, weight in near
    )
    return np.asarray(total + np.swapaxes(total, -1, -2))


def _largest(scored: Array, near: list[tuple[Integers, Integers, float]]) -> Array:
    return np.asarray(np.linalg.eigvalsh(_moran(scored, near))[..., -1])


def _p_value(
    scored: Array,
    near: list[list[tuple[Integers, Integers, float]]],
    cell: Integers,
    rng: np.random.Generator,
    draws: int,
) -> float:
    """Of the clearest of the kernels, each in units of how it scatters."""
    order = np.argsort(cell, kind="stable")
    found = np.empty((len(near), draws + 1))
    found[:, 0] = [_largest(scored, kernel) for kernel in near]
    for number in range(1, draws + 1):
        dealt = np.empty_like(scored)
        dealt[order] = scored[np.lexsort((rng.random(len(cell)), cell))]
        found[:, number] = [_largest(dealt, kernel) for kernel in near]
    spread = np.maximum(found.std(axis=1, keepdims=True), FLAT)
    best = ((found - found.mean(axis=1, keepdims=True)) / spread).max(axis=0)
    return float(np.mean(best >= best[0] - FLAT))


def _guesses(
    scored: Array,
    near: list[list[tuple[Integers, Integers, float]]],
    of: tuple[Integers, Integers, Array],
) -> Integers:
    """Mode of each row that its neighbours speak for, and the nearest of them. Shape (2, n).

    The numbers of the modes are found without the row.
    """
    modes, cell, whitened = of
    kernel = max(near, key=lambda item: float(_largest(scored, item)))
    whole = _moran(scored, kernel)
    close, nearest = np.zeros_like(scored), np.zeros_like(scored)
    alone = np.ones(len(scored), dtype=bool)
    for first, second, weight in kernel:
        step = np.zeros_like(scored)
        np.add.at(step, first, weight * scored[second])
        np.add.at(step, second, weight * scored[first])
        close += step
        nearest[alone] = step[alone]
        alone[first] = alone[second] = False
    present = np.zeros((int(cell.max()) + 1, len(whitened)), dtype=bool)
    present[cell, modes] = True
    result = np.full((2, len(modes)), -1, dtype=np.int64)
    for row, own in enumerate(scored):
        cross = np.outer(own, close[row])
        values, axes = np.linalg.eigh(whole - cross - cross.T)
        # Of three modes two numbers are alike; each counts as much as neighbours agree in it.
        numbers = whitened @ (axes * np.maximum(values, 0.0))
        for which, near_by in enumerate((close[row], nearest[row])):
            votes = np.where(present[cell[row]], numbers @ (axes.T @ near_by), np.nan)
            if np.nanmax(np.abs(votes)) > FLAT:
                result[which, row] = np.nanargmax(votes)
    return result


def _numbered(values: Integers) -> Integers:
    return np.asarray(np.unique(values, return_inverse=True)[1].reshape(-1), dtype=np.int64)
