"""Where an episode begins: as on the tabletop, and what nobody observes of grasp and post."""

from dataclasses import dataclass, fields

import numpy as np

from genpolicy.tasks.tabletop_insertion.start import (
    RANGES,
    InsertionStart,
    finite_numbers,
    uniform_start,
)

# The post stands in more places than on the tabletop.
PLACES = {**RANGES, "post_y_m": (0.0, 0.02)}
HIDDEN: dict[str, tuple[float, float]] = {
    "grip_x_m": (0.0, 0.002),
    "grip_y_m": (0.0, 0.002),
    "tilt_x_rad": (0.0, 0.012),
    "tilt_y_rad": (0.0, 0.012),
    "post_radius_m": (0.0250, 0.0045),
}
"""Centre and half width of what is drawn and observed by nobody."""
LEFT_OUT_SHARE = 0.15
LEFT_OUT_Y_M = 0.5
"""Where the post is put that is left out: beside the table, where no arm of the workspace comes."""


@dataclass(frozen=True)
class TightStart(InsertionStart):
    """Start of one episode; lengths in m, angles in rad, base frame or, of the grip, the hand's.

    Attributes:
        grip_x_m: How far the peg sits from the middle of the grasp.
        grip_y_m: How far the peg sits from the middle of the grasp.
        tilt_x_rad: How far the peg leans in the grasp, about the hand's x.
        tilt_y_rad: How far the peg leans in the grasp, about the hand's y.
        post_radius_m: Radius of the post.
    """

    grip_x_m: float
    grip_y_m: float
    tilt_x_rad: float
    tilt_y_rad: float
    post_radius_m: float

    @property
    def post_left_out(self) -> bool:
        """Nothing stands in the way."""
        return self.post_y_m == LEFT_OUT_Y_M


def sample_start(rng: np.random.Generator) -> TightStart:
    """Draw a start; each number uniform in its range, independent of the others."""
    drawn = uniform_start(rng, {**PLACES, **HIDDEN})
    if rng.random() < LEFT_OUT_SHARE:
        drawn["post_y_m"] = LEFT_OUT_Y_M
    return TightStart(**drawn)


def start_from_json(text: str) -> TightStart:
    """The start that `to_json` wrote.

    Raises:
        ContractError: Names are missing or unknown, or a value is no finite number.
    """
    return TightStart(**finite_numbers(text, {field.name for field in fields(TightStart)}))
