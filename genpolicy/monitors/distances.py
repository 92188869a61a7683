"""Energy distance between two sets of chunks: zero of equal sets, and no width to choose.

Source:
    Szekely and Rizzo 2013, with the pairs of a set with itself counted in (never below zero).
"""

from scipy.spatial.distance import cdist

from genpolicy.monitors.protocol import Array


def energy_distance(one: Array, other: Array) -> float:
    """2 E|x - y| - E|x - x'| - E|y - y'| over Euclidean distances of whole chunks.

    Args:
        one: Normalised. Shape (N, k, D_a).
        other: Normalised. Shape (M, k, D_a).
    """
    x, y = one.reshape(len(one), -1), other.reshape(len(other), -1)
    found = 2.0 * cdist(x, y).mean() - cdist(x, x).mean() - cdist(y, y).mean()
    return max(float(found), 0.0)
