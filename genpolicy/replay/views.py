"""The two views of a drawn rollout, from above and from the side, over the same workspace."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from genpolicy.tasks.api import Workspace

Array = NDArray[np.float64]

MARGIN_M = 0.03
"""Around the workspace: the TCP may not leave it, the hand reaches further."""
ABOVE, ASIDE = 0, 1


@dataclass(frozen=True)
class View:
    """One of the two views.

    Attributes:
        side: `ABOVE` or `ASIDE`.
        left: Where it begins in the drawing.
        low_m: Lower corner of what it shows.
        scale: Units of the drawing per m.
        height: Of the view.
    """

    side: int
    left: float
    low_m: Array
    scale: float
    height: float

    def places(self, outline_m: Array) -> Array:
        """Places in the drawing, to the right and down, of corners in m. Both of shape (n, 2)."""
        across = self.left + (outline_m[:, 0] - self.low_m[0]) * self.scale
        down = self.height - (outline_m[:, 1] - self.low_m[1]) * self.scale
        return np.stack([across, down], axis=1)


def views_of(workspace: Workspace, *, width: float, gap: float) -> tuple[View, View]:
    """Both views side by side, to one scale.

    Args:
        workspace: Where the TCP may be: what is shown.
        width: Of the drawing.
        gap: Between the views.
    """
    low, high = np.array(workspace.lower_m) - MARGIN_M, np.array(workspace.upper_m) + MARGIN_M
    panel = (width - gap) / 2
    scale = float(panel / (high[0] - low[0]))
    above, aside = (
        View(
            side=side,
            left=side * (panel + gap),
            low_m=low[[0, axis]],
            scale=scale,
            height=float(scale * (high[axis] - low[axis])),
        )
        for side, axis in ((ABOVE, 1), (ASIDE, 2))
    )
    return above, aside
