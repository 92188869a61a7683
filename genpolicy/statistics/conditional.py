"""Does a recorded variable explain a label, inside blocks of comparable rows?

The label (mode) and the variable (stratum) are compared only inside blocks, so what the blocks
hold constant (the observation) cannot fake an association. Rows of different blocks must be
independent: one episode may appear in one block only. Under the null the strata of a block are
exchangeable, and the permutation p-value is exact.
"""

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from genpolicy.errors import ContractError

Array = NDArray[np.float64]
Integers = NDArray[np.int64]


@dataclass(frozen=True)
class ConditionalTest:
    """Association of label and stratum inside blocks.

    Attributes:
        p_value: Permutation p-value, at least 1 / (permutations + 1).
        effect: Share of the labels' entropy inside the blocks that the stratum explains, corrected
            for what a random stratum of the same sizes explains; 0 to 1.
        effect_lower: Lower end of the jackknife interval over the rows.
        effect_upper: Upper end of the jackknife interval.
        n: Rows in blocks that hold at least two labels and two strata.
    """

    p_value: float
    effect: float
    effect_lower: float
    effect_upper: float
    n: int


def conditional_test(
    labels: NDArray[np.generic],
    strata: NDArray[np.generic],
    blocks: NDArray[np.generic],
    *,
    rng: np.random.Generator,
    permutations: int = 999,
    confidence: float = 0.95,
) -> ConditionalTest:
    """Permutation test and effect size of a stratum on a label, inside blocks.

    Args:
        labels: Mode of each row. Shape (n,).
        strata: Value of the variable of each row. Shape (n,).
        blocks: Block of each row; rows of different blocks are independent. Shape (n,).
        rng: Generator of the permutations.
        permutations: Permutations of the null.
        confidence: Nominal coverage of the interval.

    Returns:
        The test; p-value 1, effect 0 and interval (0, 1) where no block can tell.

    Raises:
        ContractError: Arrays of different length.
    """
    if not len(labels) == len(strata) == len(blocks):
        raise ContractError(
            where="a conditional test",
            found=f"arrays of {len(labels)}, {len(strata)} and {len(blocks)} rows",
            expected="one label, stratum and block per row",
            action="Build the three from the same rows.",
        )
    label, stratum, block = _codes(labels), _codes(strata), _codes(blocks)
    keep = _informative(label, stratum, block)
    label, stratum, block = label[keep], stratum[keep], _codes(block[keep])
    n = len(label)
    if n == 0:
        return ConditionalTest(1.0, 0.0, 0.0, 1.0, 0)
    draws = _permuted(stratum, block, rng=rng, draws=permutations)
    null = _explained(label, draws, block)
    observed = float(_explained(label, stratum[None], block)[0])
    hits = int(np.count_nonzero(null >= observed - 1e-12))
    p_value = (1 + hits) / (permutations + 1)
    baseline = float(null.mean())
    point = (observed - baseline) / (1.0 - baseline) if baseline < 1.0 - 1e-9 else 0.0
    half = _standard_error(label, stratum, block)
    half *= float(scipy.stats.t.isf((1.0 - confidence) / 2.0, max(1, n - 1)))
    effect, low, high = (min(1.0, max(0.0, x)) for x in (point, point - half, point + half))
    return ConditionalTest(p_value, effect, low, high, n)


def _standard_error(label: Integers, stratum: Integers, block: Integers) -> float:
    """Jackknife standard error of the explained share, each row left out once.

    Resampling rows with replacement would repeat rows, which looks like association. Source:
    Efron and Stein 1981.
    """
    of_block, in_block = _counts(block)
    of_label, in_label = _counts(block, label)
    of_stratum, in_stratum = _counts(block, stratum)
    of_cell, in_cell = _counts(block, stratum, label)
    total = float(_plogp(of_block).sum() - _plogp(of_label).sum())
    rest = float(_plogp(of_stratum).sum() - _plogp(of_cell).sum())
    total_without = total - _drop(in_block) + _drop(in_label)
    rest_without = rest - _drop(in_stratum) + _drop(in_cell)
    n = len(label)
    without = 1.0 - rest_without / np.maximum(total_without, 1e-12)
    return float(np.sqrt((n - 1) / n * np.sum((without - without.mean()) ** 2)))


def _counts(*codes: Integers) -> tuple[Integers, Integers]:
    """Count of each combination of codes, and of the combination of each row."""
    key = np.zeros(len(codes[0]), dtype=np.int64)
    for code in codes:
        key = key * (int(code.max()) + 1) + code
    _, place, counts = np.unique(key, return_inverse=True, return_counts=True)
    return counts, counts[place.reshape(-1)]


def _drop(counts: Integers) -> Array:
    return _plogp(counts) - _plogp(counts - 1)


def _explained(label: Integers, strata: Integers, block: Integers) -> Array:
    """Share of the labels' block entropy explained by each row of `strata`. Shape (draws,)."""
    labels, kinds = int(label.max()) + 1, int(strata.max()) + 1
    blocks = int(block.max()) + 1
    total = _entropy(np.bincount(block * labels + label, minlength=blocks * labels), labels)
    if total <= 0.0:
        return np.zeros(len(strata))
    cells = (block[None] * kinds + strata) * labels + label[None]
    width = blocks * kinds * labels
    flat = (cells + width * np.arange(len(strata))[:, None]).ravel()
    counts = np.bincount(flat, minlength=width * len(strata)).reshape(len(strata), -1, labels)
    rest = _plogp(counts.sum(axis=2)).sum(axis=1) - _plogp(counts).sum(axis=(1, 2))
    return np.asarray(1.0 - rest / total)


def _entropy(counts: Integers, labels: int) -> float:
    grouped = counts.reshape(-1, labels)
    return float(_plogp(grouped.sum(axis=1)).sum() - _plogp(grouped).sum())


def _plogp(counts: Integers) -> Array:
    values = counts.astype(np.float64)
    return values * np.log(np.maximum(values, 1.0))


def _permuted(
    stratum: Integers, block: Integers, *, rng: np.random.Generator, draws: int
) -> Integers:
    """Strata shuffled inside their blocks. Shape (draws, n)."""
    order = np.argsort(block, kind="stable")
    keys = block[order][None] + rng.random((draws, len(block)))
    shuffled = np.argsort(keys, axis=1)
    result = np.empty((draws, len(block)), dtype=np.int64)
    result[:, order] = stratum[order][shuffled]
    return result


def _informative(label: Integers, stratum: Integers, block: Integers) -> NDArray[np.bool_]:
    keep = np.zeros(len(label), dtype=bool)
    for value in range(int(block.max()) + 1 if len(block) else 0):
        rows = block == value
        keep[rows] = len(np.unique(label[rows])) > 1 and len(np.unique(stratum[rows])) > 1
    return keep


def _codes(values: NDArray[np.generic]) -> Integers:
    return np.asarray(np.unique(values, return_inverse=True)[1], dtype=np.int64).reshape(-1)
