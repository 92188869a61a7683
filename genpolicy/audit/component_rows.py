"""Rows about the components of an action, in one of which the audit follows the modes."""

from dataclasses import dataclass

POSITION = "position"
"""Component of the action whose modes are routes."""
OTHER = "other"
"""Columns that no named component holds."""
NOT_LOOKED_AT = {
    "hardly_varies": "hardly varies",
    "in_position": "is part of the position, compared at equal times",
    "absent": "the action has none",
    "unreadable": "could not be read",
}
"""Why modes of a component were not looked for, in words, by its state."""


@dataclass(frozen=True)
class ComponentModes:
    """`components.parquet`: modes in one component of the action.

    Attributes:
        component: One of `genpolicy.audit.components.NAMES`.
        state: Its state there; modes were looked for only where it `varies`.
        unit: Unit of the lengths; `strokes` are shares of what a column does in all.
        separation: Modes nearer than this (RMS over a chunk) are one.
        scale: Usual distance of a chunk to its nearest other one.
        spread: Median RMS spread inside situations.
        situations: Situations whose clusters were looked for.
        clusters: Of them with several clusters.
        two_mode: Situations with several modes under one observation, in phases that keep them.
        two_mode_episodes: Held-out episodes with at least one of them.
        incoherent: Situations with clusters in phases that do not keep them.
        persistent: Situations with several modes, each of which persists.
        followed: Whether the rest of the audit is about the modes of this component.
    """

    component: str
    state: str
    unit: str
    separation: float
    scale: float | None
    spread: float | None
    situations: int
    clusters: int
    two_mode: int
    two_mode_episodes: int
    incoherent: int
    persistent: int
    followed: bool


@dataclass(frozen=True)
class Tremor:
    """`tremor.parquet`: white noise on one number of the action, as it was recorded.

    Attributes:
        column: Its name.
        ratio: Median von Neumann ratio of its spread inside situations: 1 white, 0 smooth.
        spread: Median of that spread, as a share of what sets two modes apart: of the route, or a
            fifth of what the number does in all.
        white_share: Median share of white noise in all of its spread, constant differences
            included.
    """

    column: str
    ratio: float
    spread: float
    white_share: float
