"""Centre and spread of episodes of which a part, up to half, may be wrong."""

from itertools import pairwise

import numpy as np

from genpolicy.audit.data import Array, Flags, Integers, Text

# Length of the shortest half of a normal distribution, in standard deviations.
NORMAL_HALF = 2.0 * 0.6745
# Standard error of a median, in standard errors of the mean, for normal values.
MEDIAN_ERROR = 1.2533
# The spread of a dozen episodes is itself known badly: the error grows by this over their number.
FEW = 5.0


def densest_half(values: Array) -> tuple[float, float]:
    """Centre and standard deviation by the shortest interval with half of the values.

    Unlike a median it stays inside one cluster where up to half of the values lie elsewhere.
    """
    ordered = np.sort(values)
    size = (len(ordered) + 1) // 2
    if len(ordered) < 3:
        return (
            (float(np.median(ordered)), float(np.ptp(ordered)))
            if len(ordered)
            else (float("nan"), float("nan"))
        )
    widths = ordered[size - 1 :] - ordered[: len(ordered) - size + 1]
    first = int(np.argmin(widths))
    return float(np.median(ordered[first : first + size])), float(widths[first] / NORMAL_HALF)


def within_groups(values: Array, groups: Text, least: int) -> tuple[Array, float]:
    """Deviation of each value from the densest half of its group, and their common spread.

    Groups with fewer than `least` known values are held against all values.

    Returns:
        Deviations, NaN where the value is; and the spread.
    """
    known = np.isfinite(values)
    centre = np.full(len(values), densest_half(values[known])[0] if known.any() else np.nan)
    for name in np.unique(groups):
        member = groups == name
        if np.count_nonzero(member & known) >= least:
            centre[member] = densest_half(values[member & known])[0]
    deviations = values - centre
    spread = densest_half(deviations[known])[1] if known.any() else float("nan")
    return deviations, spread


def group_medians(
    values: Array, groups: Text, *, reference: float | None, least: int
) -> list[tuple[str, int, float, float]]:
    """Name, count, median deviation and its standard error of each group with known values.

    Without a reference it is the median of all; of two groups that of the larger (the first of
    equal ones), for the median of all would lie between them. The spread is that inside the
    groups, so that a group that is off does not hide itself.
    """
    known = np.isfinite(values)
    if not known.any():
        return []
    _, spread = within_groups(values, groups, least)
    total = int(np.count_nonzero(known))
    names, sizes = np.unique(groups[known], return_counts=True)
    pool = known if len(names) != 2 else known & (groups == names[np.argmax(sizes)])
    common = 0.0 if reference is not None else 1.0 / np.count_nonzero(pool)
    centre = float(np.median(values[pool])) if reference is None else reference
    few = 1.0 + FEW / total
    result = []
    for name in np.unique(groups):
        chosen = values[known & (groups == name)]
        if len(chosen):
            error = few * MEDIAN_ERROR * spread * float(np.sqrt(1.0 / len(chosen) + common))
            result.append((str(name), len(chosen), float(np.median(chosen)) - centre, error))
    return result


def episode_medians(values: Array, starts: Integers) -> Array:
    """Median over the rows of each episode; NaN without rows. Shape (E,) or (E, D)."""
    shape = (len(starts) - 1, *values.shape[1:])
    result = np.full(shape, np.nan)
    for number, (a, b) in enumerate(pairwise(starts)):
        if b > a:
            result[number] = np.median(values[a:b], axis=0)
    return result


def episode_sums(values: Array, starts: Integers) -> Array:
    """Sum over the rows of each episode; 0 without rows. Shape (E,) or (E, D)."""
    result = np.zeros((len(starts) - 1, *values.shape[1:]))
    filled = starts[1:] > starts[:-1]
    if filled.any():
        result[filled] = np.add.reduceat(values, starts[:-1][filled], axis=0)
    return result


def episode_deviation(values: Array, starts: Integers) -> Array:
    """Standard deviation inside each episode. Shape (E,) or (E, D)."""
    return np.sqrt(_means(episode_centred(values, starts) ** 2, starts))


def episode_centred(values: Array, starts: Integers) -> Array:
    """Values without the mean of their episode. Shape of `values`."""
    return values - np.repeat(_means(values, starts), np.diff(starts), axis=0)


def _means(values: Array, starts: Integers) -> Array:
    count = np.maximum(np.diff(starts), 1).reshape(-1, *[1] * (values.ndim - 1))
    return np.asarray(episode_sums(values, starts) / count)


def some(chosen: Flags, total: int, share: float) -> bool:
    """Whether the chosen are more than chance and a mishap: two, and a share of the total."""
    count = int(np.count_nonzero(chosen))
    return count >= 2 and count - share * total >= 0
