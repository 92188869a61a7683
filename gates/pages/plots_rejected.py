"""Gallery of Gate C: rejected proposals in the scene, with the action that offends."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Polygon, Rectangle
from matplotlib.ticker import FuncFormatter, MaxNLocator

from gates.evidence import Array, Evidence, MissingEvidenceError
from gates.feasibility.settings import LAYERS, SHADOW, UNKNOWN
from gates.pages.bound import require_bound
from gates.pages.figures import Drawing, Series, colours
from gates.pages.reasons import LIMIT_WORDS, REASON_WORDS, personal, said
from gates.report import GateReport
from genpolicy.evidence.documents.gallery import GALLERY, DrawnBody, Gallery, RejectedExample
from genpolicy.pages.figures.drawing import GREY, INK, RED
from genpolicy.pages.figures.situations import STONE

FILE = f"{SHADOW}/{GALLERY.file}"
SIZE_IN = (4.5, 2.4)
"""Width at which 9 points are 9 pixels or more in a page of 420."""
NEAREST_M, ROOM_M = 0.05, 0.018  # half of the least that is shown, and what is left around a path
FORBIDDEN = "#F6E7DF"
LOOKS = {"obstacle": STONE, "target": "#CFE3DA", "scene": "#E8E1D3"}


def _drawings(evidence: Evidence, report: GateReport) -> list[Drawing]:
    require_bound(evidence, report, FILE)
    gallery = evidence.document(SHADOW, GALLERY)
    if not gallery.examples:
        raise MissingEvidenceError("no held-out candidate that has a path was rejected")
    look = colours(example.method for example in gallery.examples)
    return [
        Drawing(
            f"{example.method}: {said(example.reason)}",
            _text(gallery, example),
            lambda example=example: _figure(gallery, example, look[example.method]),  # type: ignore[misc]
        )
        for example in gallery.examples
    ]


def _text(gallery: Gallery, example: RejectedExample) -> tuple[str, ...]:
    words = REASON_WORDS.get(example.reason, "for a reason that nobody knows")
    what = f"{words[0].upper()}{words[1:]}"
    if example.touching:
        what += f": {said(' and '.join(example.touching))}"
    return (
        f"{what}.",
        f"{_where(gallery, example)} {_how_far(example)}",
        f"The {example.layer} layer rejects {example.rejected} of {example.held_out} held-out "
        f"candidates of {example.method} for it. This one: candidate {example.candidate} of "
        f"observation {example.observation}, phase {example.phase}, mode {example.mode}.",
    )


def _where(gallery: Gallery, example: RejectedExample) -> str:
    if example.row is None:
        return "As a whole it"
    begins = personal([example.row * gallery.action_period_s], "s")
    return f"Action {example.row} (of 0 to {len(example.raw_m) - 1}, {begins} after the first)"


def _how_far(example: RejectedExample) -> str:
    """How far beyond which limit, in units of a person."""
    if example.outcome == UNKNOWN:
        return "cannot be evaluated, which is not passed."
    if example.margin is None or (example.unit == "1" and not example.limits):
        return "offends."
    limit = ""
    if example.limits:
        noun = LIMIT_WORDS[example.reason]
        limit = f"; {noun}: {_quantity(example.limits, example.unit)}"
    return f"is beyond the limit by {_quantity([-example.margin], example.unit)}{limit}."


def _quantity(values: Sequence[float], unit: str) -> str:
    """Values as a person reads them; of a limit on either of two quantities both."""
    kinds = unit.split(" or ")
    if len(kinds) == 1:
        return personal(values, unit)
    each = values if len(values) == len(kinds) else [values[0]] * len(kinds)
    pairs = zip(each, kinds, strict=True)
    return " or ".join(personal([value], kind) for value, kind in pairs)


def _figure(gallery: Gallery, example: RejectedExample, colour: str) -> Figure:
    raw, projected = _points(example.raw_m), _points(example.projected_m)
    start = np.array([example.commanded_m])
    # Behind the last command only what is not late; what is late is never executed.
    paths = [np.concatenate([start, rows[example.late_rows :]]) for rows in (raw, projected)]
    wrong, before, beside = _offence(example, raw, projected)
    shown = [*paths, wrong]
    centre, half = _window(np.concatenate(shown), _touching(example))
    figure = Figure(figsize=SIZE_IN, layout="constrained")
    pair = figure.subplots(1, 2)
    cut_m = float(wrong[0, 1]) if len(wrong) else float(start[0, 1])
    for axes, second in zip(pair, (1, 2), strict=True):
        axes.set_xlim(centre[0] - half, centre[0] + half)
        axes.set_ylim(centre[second] - half, centre[second] + half)
        axes.set_aspect("equal")
        _draw_workspace(axes, gallery, second)
        for body in example.bodies:
            _draw_body(axes, gallery, body, second, cut_m)
        _draw_paths(axes, paths, second, colour)
        if len(wrong):
            _draw_offence(axes, wrong[0], before, beside, second)
        _label(axes, second)
    pair[0].set_title("from above")
    pair[1].set_title(f"cut at y = {1e3 * cut_m:.0f} mm".replace("-", "−"))
    return figure


def _points(rows: Sequence[list[float] | None]) -> Array:
    """Positions, NaN where one is not finite. Shape (n, 3)."""
    return np.array([row or [np.nan] * 3 for row in rows], dtype=np.float64).reshape(-1, 3)


def _offence(example: RejectedExample, raw: Array, projected: Array) -> tuple[Array, Array, Array]:
    """The offending action, as sampled where that is judged; where it comes from; its other self.

    Returns:
        Shapes (0 or 1, 3), (3,), (3,).
    """
    start = np.array(example.commanded_m)
    if example.row is None:
        return np.zeros((0, 3)), start, start
    row = example.row
    own, other = (raw, projected) if example.layer == LAYERS[0] else (projected, raw)
    found = own[row : row + 1]
    before = start if row <= example.late_rows else own[row - 1]
    return found[np.all(np.isfinite(found), axis=1)], before, other[row]


def _touching(example: RejectedExample) -> list[DrawnBody]:
    """What of the robot touches something."""
    return [body for body in example.bodies if body.touches and body.kind == "robot"]


def _window(points: Array, bodies: Sequence[DrawnBody]) -> tuple[Array, float]:
    """Centre, and half of what is shown around it, the same along each axis."""
    low, high = np.nanmin(points, axis=0), np.nanmax(points, axis=0)
    for body in bodies:
        for outline, axis in ((body.above_m, (0, 1)), (body.aside_m, (0, 2))):
            corners = np.array(outline)
            low[list(axis)] = np.minimum(low[list(axis)], corners.min(axis=0))
            high[list(axis)] = np.maximum(high[list(axis)], corners.max(axis=0))
    return (low + high) / 2, max(NEAREST_M, float(np.max(high - low)) / 2 + ROOM_M)


def _draw_workspace(axes: Axes, gallery: Gallery, second: int) -> None:
    """Where the TCP may be; everything else is tinted."""
    lower, upper = gallery.workspace_m
    size = upper[0] - lower[0], upper[second] - lower[second]
    axes.set_facecolor(FORBIDDEN)
    axes.add_patch(
        Rectangle((lower[0], lower[second]), *size, fc="white", ec=GREY, lw=0.8, ls="--")
    )


def _draw_body(axes: Axes, gallery: Gallery, body: DrawnBody, second: int, cut_m: float) -> None:
    """One shape: from above whole, from the side filled where the plane goes through it."""
    corners, above = body.above_m if second == 1 else body.aside_m, np.array(body.above_m)
    (left, front), (right, back) = above.min(axis=0), above.max(axis=0)
    if second == 1 and left <= gallery.workspace_m[0][0] and right >= gallery.workspace_m[1][0]:
        return  # what lies under everything is seen from the side
    look: dict[str, Any] = {"fc": "none", "ec": RED if body.touches else INK, "lw": 0.8}
    if body.kind == "robot":
        mine = {"fc": (*to_rgb(RED), 0.18)} if body.touches else {"ec": GREY, "lw": 0.6}
        look |= mine | {"zorder": 3}
    elif second == 1 or front <= cut_m <= back:
        look |= {"fc": LOOKS.get(body.kind, STONE), "zorder": 2}
    else:
        look |= {"ec": RED if body.touches else GREY, "ls": ":", "zorder": 2.5}
    axes.add_patch(Polygon(corners, **look))


def _draw_paths(axes: Axes, paths: Sequence[Array], second: int, colour: str) -> None:
    raw, projected = paths
    axes.plot(
        projected[:, 0], projected[:, second], color=colour, lw=2.0, marker=".", ms=5, zorder=4
    )
    axes.plot(
        *raw[:, [0, second]].T, color=INK, lw=0.9, ls=(0, (3, 2)), marker="o", ms=2.4,
        mfc="white", mew=0.6, zorder=5,
    )  # fmt: skip
    axes.plot(*raw[0, [0, second]], marker="s", ms=5.5, color=INK, mec="white", zorder=6)


def _draw_offence(axes: Axes, wrong: Array, before: Array, beside: Array, second: int) -> None:
    """The offending action, the way that leads to it, and its place on the other path."""
    pair = [0, second]
    axes.plot(*np.stack([before, wrong])[:, pair].T, color=RED, lw=2.4, zorder=5.5)
    axes.plot(*np.stack([wrong, beside])[:, pair].T, color=RED, lw=0.9, ls=":", zorder=5.5)
    axes.plot(*wrong[pair], marker="X", ms=7, color=RED, mec="white", mew=0.8, zorder=7)


def _label(axes: Axes, second: int) -> None:
    axes.grid(visible=False)
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MaxNLocator(3, steps=[1, 2, 5, 10]))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{1e3 * value:.0f}"))
    axes.set_xlabel("x, mm")
    axes.set_ylabel(f"{'xyz'[second]}, mm")


GALLERIES = (
    Series(
        "Rejected proposals",
        "Of each method its most frequent reasons, six at most, on held-out observations; of each "
        "reason the candidate in the middle, ordered by margin: nobody picks. Path of the tool "
        "centre point from the last command (square): dashed as sampled, solid in the method's "
        "colour as projected. The cross is the first action that offends, the thick line the way "
        "to it, the outlines the hand there with what it holds, red what touches. From the side, "
        "filled is what the plane through that action cuts, dotted what stands before or behind "
        "it. Green is the target, grey an obstacle, tinted what lies outside of the workspace. "
        "Each was judged again when it was chosen. `genpolicy replay` shows the session "
        "METHOD/held_out/OBSERVATION of the journal in three dimensions.",
        FILE,
        _drawings,
    ),
)
