"""A rollout as a moving drawing: from above and from the side, with force and age under it.

Every moment is a drawing of its own on top of what stands still, and a radio button shows it; the
style sheet plays them one after the other. So the page needs no script, and a keyboard plays,
pauses and steps with the browser's own controls. Nothing in it comes from text of the evidence but
names of phases and modes, which are escaped.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from markupsafe import Markup, escape

from gates.evidence import Array
from gates.pages.reasons import personal
from genpolicy.replay.film import PERIOD_S, Film, Frame
from genpolicy.replay.views import ABOVE, View, views_of
from genpolicy.tasks.api import Workspace

WIDTH, GAP = 320.0, 8.0
"""Units of the drawing; one is about a pixel where three clips stand side by side."""
STRIP, LABELS = 34.0, 14.0
"""Height of the strip of force and of that of age, and of the names above and between them."""
NARROW = 34.0
"""A phase that takes less of the strip is not named in it."""
OTHERS = {"fallback": "fallback", "intervention": "person"}
"""Who commands where the policy does not, and how that is drawn."""
LEAST_WIDE = 6.0


SHOW = (
    ("whole", "end"),
    ("run", "play"),
    ("hold", "pause"),
    ("step", "step"),
)
"""Controls of a clip: class for the style sheet, and name; the first is how a page begins."""


def drawn_clip(film: Film, workspace: Workspace, number: int, *, said: str) -> Markup:
    """The drawing of a film and its controls.

    Args:
        film: What to draw.
        workspace: Where the TCP may be: what is shown, the same in every clip.
        number: Of the clip on its page; its controls move it and no other.
        said: What it shows, for who does not see it.
    """
    name = f"clip{number}"
    views = views_of(workspace, width=WIDTH, gap=GAP)
    top = max(view.height for view in views)
    height = top + 2 * (LABELS + STRIP) + LABELS
    box = Markup('viewBox="0 0 {:.0f} {:.0f}"').format(WIDTH, height)
    parts = [
        Markup(
            '<div class="clip" role="group" aria-label="{}"><svg {} role="img" '
            'aria-label="{}: a rollout from above and from the side">'
        ).format(said, box, said)
    ]
    layers = [_layers(film, view) for view in views]
    titles = ("from above", "from the side")
    for view, (still, _), title in zip(views, layers, titles, strict=True):
        parts += [*_still(film, view, name, still), _text(view.left + 3, 11, title)]
    parts += _strip(film, FORCE, film.forces, top)
    parts += _strip(film, AGE, film.ages, top + LABELS + STRIP)
    parts += [*_phases(film, height), Markup("</svg>"), *_controls(name)]
    for place in range(len(film.frames)):
        at_s = min(place * PERIOD_S, film.duration_s)
        parts += [
            Markup(
                '<input type="radio" name="{}at" aria-label="{:.1f} s"{}>'
                '<svg class="moment" style="--k:{}" {} aria-hidden="true">'
            ).format(name, at_s, Markup("" if place else " checked"), place, box),
            *(
                _clipped(view, name, moving[place])
                for view, (_, moving) in zip(views, layers, strict=True)
            ),
            Markup('<path class="now" d="M{:.1f} {:.1f}V{:.1f}"/></svg>').format(
                _x(film, at_s), top, height - LABELS
            ),
        ]
    return Markup("").join([*parts, Markup("</div></div>")])


def _controls(name: str) -> Iterator[Markup]:
    """The radio buttons of a clip, and the beginning of those of its moments."""
    yield Markup("<fieldset><legend>Show</legend>")
    for place, (kind, label) in enumerate(SHOW):
        yield Markup('<label><input type="radio" name="{}" class="{}"{}> {}</label> ').format(
            name, kind, Markup("" if place else " checked"), label
        )
    yield Markup(
        '</fieldset><div class="moments" role="group" aria-label="Moments: arrow keys step">'
    )


def _points(view: View, outline: Array) -> str:
    """Corners (n, 2), m, as an attribute of SVG."""
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in view.places(outline).tolist())


def _layers(film: Film, view: View) -> tuple[list[Markup], list[list[Markup]]]:
    """Outlines that stand still all the time, and those of each frame that do not."""
    every = [list(_outlines(frame, view)) for frame in film.frames]
    still = [shape for shape in every[0] if all(shape in shapes for shapes in every)]
    return still, [[shape for shape in shapes if shape not in still] for shapes in every]


def _outlines(frame: Frame, view: View) -> Iterator[Markup]:
    """Scene, what is held and the hand, as they stand in a frame."""
    for kind, outline in (*frame.scene, ("held", frame.held), ("hand", frame.hand)):
        if outline is not None:
            corners = _points(view, outline[view.side])
            yield Markup('<polygon class="{}" points="{}"/>').format(kind, corners)


def _still(film: Film, view: View, name: str, shapes: Sequence[Markup]) -> Iterator[Markup]:
    """Table, what never moves, and the way of the hand."""
    panel = (WIDTH - GAP) / 2
    place = Markup('x="{:.1f}" width="{:.1f}" height="{:.1f}"').format(
        view.left, panel, view.height
    )
    yield Markup('<clipPath id="{}"><rect {}/></clipPath>').format(_window(view, name), place)
    yield Markup('<rect class="table" {}/>').format(place)
    way = Markup("")
    if len(film.path_m):
        axes = [0, 1] if view.side == ABOVE else [0, 2]
        way = Markup('<polyline class="path" points="{}"/>').format(
            _points(view, film.path_m[:, axes])
        )
    yield _clipped(view, name, [*shapes, way])


def _clipped(view: View, name: str, shapes: Sequence[Markup]) -> Markup:
    inside = Markup("").join(shapes)
    return Markup('<g clip-path="url(#{})">{}</g>').format(_window(view, name), inside)


def _window(view: View, name: str) -> str:
    return f"{name}{'above' if view.side == ABOVE else 'side'}"


@dataclass(frozen=True)
class Quantity:
    """What a strip shows over time.

    Attributes:
        title: Its name.
        unit: Of the values.
        least: A strip is at least this high: a tremor of nothing must not fill it.
    """

    title: str
    unit: str
    least: float


FORCE, AGE = Quantity("force", "N", 10.0), Quantity("age of action", "s", 0.1)


def _strip(
    film: Film, of: Quantity, series: Sequence[tuple[float, float]], top: float
) -> Iterator[Markup]:
    """One quantity over time, as a bar at each moment at which it was measured."""
    base = top + LABELS + STRIP
    most = max((value for _, value in series), default=0.0)
    full = max(most, of.least)
    said = f"{of.title}, at most {personal([most], of.unit)}" if series else f"{of.title}: none"
    yield _text(0, base - STRIP - 3, said)
    yield Markup('<path class="strip" d="M0 {0:.1f}H{1:.0f}"/>').format(base, WIDTH)
    bars = "".join(
        f"M{_x(film, at_s):.1f} {base:.1f}v{-STRIP * value / full:.1f}" for at_s, value in series
    )
    if bars:
        yield Markup('<path class="measured" d="{}"/>').format(bars)


def _phases(film: Film, height: float) -> Iterator[Markup]:
    """Where each phase begins, and who commands where it is not the policy."""
    for phase, begin_s, end_s in _spans(film, film.phases):
        left, right = _x(film, begin_s), _x(film, end_s)
        yield Markup('<path class="phase" d="M{:.1f} {:.1f}V{:.1f}"/>').format(
            left, height - LABELS - 2 * (LABELS + STRIP), height - LABELS
        )
        if right - left >= NARROW:
            yield _text(left + 2, height - 3, phase)
    for mode, begin_s, end_s in _spans(film, film.modes):
        if mode in OTHERS:
            # An intervention ends a rollout: what has no width is drawn where it is seen.
            wide = max(_x(film, end_s) - _x(film, begin_s), LEAST_WIDE)
            yield Markup(
                '<rect class="{}" x="{:.1f}" y="{:.1f}" width="{:.1f}" height="4">'
                "<title>{}</title></rect>"
            ).format(
                OTHERS[mode], min(_x(film, begin_s), WIDTH - wide), height - LABELS - 4, wide, mode
            )


def _spans(
    film: Film, marks: Sequence[tuple[float, str]]
) -> Iterator[tuple[str, float, float]]:  # fmt: skip
    """What began when, with when the next began."""
    for place, (begin_s, name) in enumerate(marks):
        later = marks[place + 1][0] if place + 1 < len(marks) else film.duration_s
        yield name, begin_s, later


def _x(film: Film, at_s: float) -> float:
    return WIDTH * at_s / max(film.duration_s, PERIOD_S)


def _text(x: float, y: float, text: str) -> Markup:
    return Markup('<text x="{:.1f}" y="{:.1f}">{}</text>').format(x, y, escape(text))
