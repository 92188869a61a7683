"""Which observed number does each commanded number command? By name; by the numbers if unnamed."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from genpolicy.data.formats.contract import SI, ActionSource, ChannelSource
from genpolicy.data.formats.units import STATED, tokens

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

FILLERS = {
    *("position", "pos", "target", "cmd", "command", "commanded", "goal", "desired", "action"),
    *("actions", "state", "observation", "obs", "leader", "follower", "main", "measured", "data"),
    *("joint", "qpos", "abs", "absolute", "low", "dim", *STATED),
}
NUMBERED = {"joint", "qpos", "motor"}
OWN_BODY = {
    *("tcp", "eef", "ee", "robot", "robot0", "agent", "state", "qpos", "joint", "joints"),
    *("gripper", "arm", "hand", "proprio", "follower"),
}
LAGS = (0, 1, 2, 4, 8, 12)
SAME_SCALE = (0.7, 1.4)
MAXIMUM_RESIDUAL = 0.5
DIFFERENCE_CORRELATION = 0.5
DIFFERENCE_LEAD = 0.1
MINIMUM_SAMPLES = 20


def pair_by_name(channels: Sequence[ChannelSource], action: ActionSource) -> dict[str, str] | None:
    """Component of the action to the `channel.component` of the same name and unit.

    The whole name of the observed number is tried first, then its component alone, in channels
    that are named after the robot's own body.

    Returns:
        One to one, in the order of the action; None if no name is found on both sides.
    """
    observed = [
        (channel, component)
        for channel in channels
        if channel.transform == "none"
        for component in channel.components
    ]
    units = dict(zip(action.components, action.units, strict=True))
    result: dict[str, str] = {}
    for commanded in action.components:
        wanted = _key(commanded)
        if not wanted:
            continue
        for channel, component in _ranked(observed, wanted):
            name = f"{channel.name}.{component}"
            same_unit = SI.get(units[commanded], (units[commanded],))[0] == channel.dataset_unit
            if same_unit and name not in result.values():
                result[commanded] = name
                break
    return result or None


def _ranked(
    observed: list[tuple[ChannelSource, str]], wanted: frozenset[str]
) -> list[tuple[ChannelSource, str]]:
    own = [pair for pair in observed if OWN_BODY & set(tokens(pair[0].name))]
    whole = [pair for pair in observed if _key(f"{pair[0].name} {pair[1]}") == wanted]
    return [*whole, *(pair for pair in own if _key(pair[1]) == wanted)]


def _key(name: str) -> frozenset[str]:
    """The words of a name that tell one number from another; empty for a mere `state_3`."""
    words = frozenset(tokens(name))
    if words - FILLERS and not all(word.isdigit() for word in words - FILLERS):
        return words - FILLERS
    digits = {word for word in words if word.isdigit()}
    return words & (NUMBERED | digits) if words & NUMBERED and digits else frozenset()


def pair_by_numbers(
    observed: Array, commanded: Array, episode: Integers
) -> list[tuple[int, int]] | None:
    """Which observed number follows each commanded number, found in the numbers alone.

    A pair must have the same scale and the observed one must follow within `LAGS` rows, so that a
    velocity, a difference or another robot's joint does not pair.

    Args:
        observed: Shape (n, D_o).
        commanded: Shape (n, D_a).
        episode: Which episode each row belongs to. Shape (n,).

    Returns:
        (index of the action, index of the observation), one to one; None if nothing pairs.
    """
    if len(observed) < MINIMUM_SAMPLES:
        return None
    cost = np.full((commanded.shape[1], observed.shape[1]), np.inf)
    for lag in LAGS:
        later = np.arange(lag, len(observed))
        same = episode[later] == episode[later - lag]
        seen, told = observed[later[same]], commanded[later[same] - lag]
        if len(seen) < MINIMUM_SAMPLES:
            continue
        cost = np.minimum(cost, _residual(told, seen))
    pairs: list[tuple[int, int]] = []
    while np.isfinite(cost).any() and cost.min() <= MAXIMUM_RESIDUAL:
        row, column = np.unravel_index(int(np.argmin(cost)), cost.shape)
        pairs.append((int(row), int(column)))
        cost[row, :] = np.inf
        cost[:, column] = np.inf
    return sorted(pairs) or None


def _residual(told: Array, seen: Array) -> Array:
    """RMS distance in units of the commanded spread; infinite where the scales differ."""
    with np.errstate(over="ignore"):  # a damaged number pairs with nothing
        spread_told, spread_seen = told.std(axis=0), seen.std(axis=0)
    floor = 1e-9 * (1.0 + np.abs(told).max(axis=0))
    result = np.full((told.shape[1], seen.shape[1]), np.inf)
    for i in np.flatnonzero(spread_told > floor):
        ratio = spread_seen / spread_told[i]
        for j in np.flatnonzero((ratio >= SAME_SCALE[0]) & (ratio <= SAME_SCALE[1])):
            distance = np.sqrt(np.mean((seen[:, j] - told[:, i]) ** 2))
            result[i, j] = distance / spread_told[i]
    return result


def are_differences(observed: Array, commanded: Array, episode: Integers) -> bool:
    """Whether most commanded numbers follow the *change* of their observed one, not its value.

    Args:
        observed: The paired observed numbers. Shape (n, P).
        commanded: What is commanded of them. Shape (n, P).
        episode: Which episode each row belongs to. Shape (n,).
    """
    inside = np.flatnonzero(np.diff(episode) == 0)
    if len(inside) < MINIMUM_SAMPLES:
        return False
    told, seen = commanded[inside], observed[inside]
    change = observed[inside + 1] - seen
    votes = 0
    for i in range(seen.shape[1]):
        moved = _correlation(told[:, i], change[:, i])
        explains = moved > DIFFERENCE_CORRELATION
        better = moved > _correlation(told[:, i], seen[:, i]) + DIFFERENCE_LEAD
        votes += int(explains and better and not _is_same_place(told[:, i], seen[:, i]))
    return 2 * votes > int(seen.shape[1])


def _is_same_place(told: Array, seen: Array) -> bool:
    """Same spread about the same centre: a fast target leads its response, and is yet a place."""
    spread, width = float(seen.std()), float(told.std())
    near = abs(float(told.mean() - seen.mean())) <= spread
    return near and SAME_SCALE[0] * spread <= width <= SAME_SCALE[1] * spread


def _correlation(a: Array, b: Array) -> float:
    if a.std() == 0 or b.std() == 0:
        return 0.0
    return float(np.corrcoef(a, b)[0, 1])
