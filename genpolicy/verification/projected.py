"""What projection may make of a chunk, proved from the chunk as drawn and as admitted.

A gripper that is told to go beyond its range was told by no policy that knows it, and a chunk that
had to be moved or turned far is another chunk. Both are asked of all rows, the late ones too.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from genpolicy.verification.contact import ROUNDING
from genpolicy.verification.journal_source import Message, floats
from genpolicy.verification.pose import GRIPPER, POSITION, ROTATION, angle_rad, turned_by

Finding = tuple[str, str]


@dataclass(frozen=True)
class ExpectedProjection:
    """What a chunk as drawn may ask for, and by how much it may be changed.

    Attributes:
        opening_m: Least and largest opening of each finger that may be commanded.
        beyond_m: By how much a drawn opening may leave that range.
        moved_m: Largest change of a position.
        turned_rad: Largest change of a rotation.
    """

    opening_m: tuple[float, float]
    beyond_m: float
    moved_m: float
    turned_rad: float

    def objections(self, chunk: Message) -> Iterator[Finding]:
        """What is wrong with an `enqueue` event; nothing if projection did what it may."""
        actions = floats(chunk["actions"]).reshape(chunk["rows"], -1)
        raw = floats(chunk["raw"] or chunk["actions"]).reshape(chunk["rows"], -1)
        name, (least_m, most_m) = repr(chunk["chunk_id"]), self.opening_m
        for what, rows, beyond_m in (("drawn", raw, self.beyond_m), ("told", actions, 0.0)):
            opening = rows[:, GRIPPER]
            slack_m = beyond_m + ROUNDING * most_m
            if not np.all((opening >= least_m - slack_m) & (opening <= most_m + slack_m)):
                ends = f"{np.min(opening):.4g} to {np.max(opening):.4g} m"
                yield "P6.gripper", f"The gripper is {what} to open {ends} by {name}."
        moved_m = np.linalg.norm(actions[:, POSITION] - raw[:, POSITION], axis=1)
        if not np.all(moved_m <= self.moved_m * (1 + ROUNDING)):
            yield "P6.projection", f"{name} was moved {np.max(moved_m):.4g} m from what was drawn."
        turned = angle_rad(turned_by(raw[:, ROTATION]), turned_by(actions[:, ROTATION]))
        if not np.all(turned <= self.turned_rad * (1 + ROUNDING)):
            yield "P6.projection", f"{name} was turned {np.max(turned):.4g} rad."
