"""`gallery.json` of shadow: examples of what was rejected, with all that a drawing needs."""

from dataclasses import dataclass

from genpolicy.documents.document import Count, Document

Point = list[float]


@dataclass(frozen=True)
class DrawnBody:
    """One shape as a drawing shows it, in the base frame.

    Attributes:
        name: Name of the shape.
        kind: `obstacle` (stands in the way), `target` (what is held goes in), `scene`, or `robot`.
        touches: Whether it is one of the two that touch.
        above_m: Corners of its outline seen from above: x, y.
        aside_m: Corners of its outline seen from the side: x, z.
    """

    name: str
    kind: str
    touches: bool
    above_m: list[Point]
    aside_m: list[Point]


@dataclass(frozen=True)
class RejectedExample:
    """One rejected candidate, chosen by the rule of `evidence.shadow.gallery`.

    Attributes:
        method: Its method.
        layer: Layer that rejected it.
        reason: The check that it was rejected for.
        outcome: `failed`, or `unknown` where the check could not be evaluated.
        rejected: Held-out candidates of the method that were rejected for the same reason.
        held_out: Held-out candidates of the method.
        situation: Episode and row.
        phase: Task phase.
        mode: Mode of its path, as the task names it.
        observation: Number of the observation.
        candidate: Number of the candidate.
        row: First offending action, counted from 0; None where there is none.
        late_rows: Actions at its beginning that come too late and are never executed.
        margin: Limit minus value, in `unit`; None where it is no number.
        unit: Unit of margin and limits.
        limits: What the margin is counted from: one number, or one of each joint; none where the
            check asks for yes or no, or for a region.
        touching: The shape of the robot and the other one that touch; empty where none do.
        commanded_m: The TCP as commanded last, from where the motion begins.
        raw_m: Its positions as sampled; None where one is not finite.
        projected_m: Its positions after projection, likewise.
        bodies: The scene as it was seen; and the tool at the offending action with what it holds,
            together with whatever else of the robot touches something there.
    """

    method: str
    layer: str
    reason: str
    outcome: str
    rejected: Count
    held_out: Count
    situation: str
    phase: str
    mode: str
    observation: Count
    candidate: Count
    row: Count | None
    late_rows: Count
    margin: float | None
    unit: str
    limits: list[float]
    touching: list[str]
    commanded_m: Point
    raw_m: list[Point | None]
    projected_m: list[Point | None]
    bodies: list[DrawnBody]


@dataclass(frozen=True)
class Gallery:
    """Examples of rejected candidates.

    Attributes:
        workspace_m: Lowest and highest x, y, z that the TCP may be at.
        action_period_s: Time between actions.
        examples: By method, of each the most frequent reason first.
    """

    workspace_m: list[Point]
    action_period_s: float
    examples: list[RejectedExample]


GALLERY = Document("gallery.json", Gallery)
