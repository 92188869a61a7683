"""How far bodies of the scene have moved since a chunk was checked, from what a journal says."""

import math

import numpy as np

from genpolicy.verification.journal_source import floats

LEVER_M = 0.1
"""A turn counts as the way of a point this far from a body's origin."""


def moved_m(checked: dict[str, str], seen: dict[str, str] | None) -> float:
    """Longest way of a body between two scenes, m; infinite where they are not of one set of them.

    Args:
        checked: Bodies by name: x, y, z, m, and w, x, y, z, as a journal has numbers.
        seen: Likewise; None where nobody has said it.
    """
    if seen is None or set(checked) != set(seen):
        return math.inf
    longest_m = 0.0
    for name, text in checked.items():
        before, now = floats(text), floats(seen[name])
        if not before.shape == now.shape == (7,):
            return math.inf
        turned = min(np.linalg.norm(before[3:] - now[3:]), np.linalg.norm(before[3:] + now[3:]))
        # The chord between two unit quaternions is twice the sine of a quarter of the turn.
        way_m = float(np.linalg.norm(before[:3] - now[:3])) + 2 * LEVER_M * math.sin(
            2 * math.asin(min(float(turned) / 2, 1.0))
        )
        longest_m = max(longest_m, way_m) if math.isfinite(way_m) else math.inf
    return longest_m
