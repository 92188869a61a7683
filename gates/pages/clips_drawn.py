"""A rollout as a moving drawing: from above and from the side, with force and age under it.

SVG with its own animation, so that the page needs no script: it stands still at the end with the
whole path, and plays when it is clicked. Nothing in it comes from text of the evidence but names of
phases and modes, which are escaped.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from markupsafe import Markup, escape

from gates.evidence import Array
from gates.pages.reasons import personal
from genpolicy.replay.film import PERIOD_S, Film, Frame, Outline
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


def drawn_clip(film: Film, workspace: Workspace, number: int, *, said: str) -> Markup:
    """The drawing of a film.

    Args:
        film: What to draw.
        workspace: Where the TCP may be: what is shown, the same in every clip.
        number: Of the clip on its page; a click on it plays it and no other.
        said: What it shows, for who does not see it.
    """
    name = f"clip{number}"
    views = views_of(workspace, width=WIDTH, gap=GAP)
    top = max(view.height for view in views)
    height = top + 2 * (LABELS + STRIP) + LABELS
    parts = [
        Markup(
            '<svg class="clip" id="{}" viewBox="0 0 {:.0f} {:.0f}" role="img" '
            'aria-label="{}: a rollout from above and from the side; a click plays it">'
        ).format(name, WIDTH, height, said)
    ]
    for view, title in zip(views, ("from above", "from the side"), strict=True):
        parts += [*_view(film, view, name), _text(view.left + 3, 11, title)]
    parts += _strip(film, FORCE, film.forces, top)
    parts += _strip(film, AGE, film.ages, top + LABELS + STRIP)
    parts += [*_phases(film, height), *_hand_of_time(film, name, top, height), Markup("</svg>")]
    return Markup("").join(parts)


def _points(view: View, outline: Array) -> str:
    """Corners (n, 2), m, as an attribute of SVG."""
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in view.places(outline).tolist())


def _view(film: Film, view: View, name: str) -> Iterator[Markup]:
    """Scene, path, what is held and the hand, clipped to the view."""
    panel = (WIDTH - GAP) / 2
    yield Markup('<svg x="{:.1f}" width="{:.1f}" height="{:.1f}" viewBox="{} 0 {} {}">').format(
        view.left, panel, view.height,
        *(f"{number:.1f}" for number in (view.left, panel, view.height)),
    )  # fmt: skip
    yield Markup('<rect class="table" x="{:.1f}" width="{:.1f}" height="{:.1f}"/>').format(
        view.left, panel, view.height
    )
    for place, (kind, _) in enumerate(film.frames[-1].scene):
        yield _moving(film, view, kind, lambda frame, place=place: frame.scene[place][1], name)  # type: ignore[misc]
    if len(film.path_m):
        axes = [0, 1] if view.side == ABOVE else [0, 2]
        path = _points(view, film.path_m[:, axes])
        yield Markup('<polyline class="path" points="{}"/>').format(path)
    yield _moving(film, view, "held", lambda frame: frame.held, name)
    yield _moving(film, view, "hand", lambda frame: frame.hand, name)
    yield Markup("</svg>")


def _moving(
    film: Film, view: View, kind: str, of: Callable[[Frame], Outline | None], name: str
) -> Markup:
    """One outline over all frames; one that never moves is not animated."""
    found = [of(frame) for frame in film.frames]
    values = ["" if outline is None else _points(view, outline[view.side]) for outline in found]
    if len(set(values)) == 1:
        return Markup('<polygon class="{}" points="{}"/>').format(kind, values[-1])
    return Markup(
        '<polygon class="{}" points="{}"><animate attributeName="points" begin="{}.click" '
        'dur="{:.1f}s" calcMode="discrete" values="{}"/></polygon>'
    ).format(kind, values[-1], name, len(values) * PERIOD_S, ";".join(values))


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


def _hand_of_time(film: Film, name: str, top: float, height: float) -> Iterator[Markup]:
    """The line that goes through the strips while the clip plays."""
    yield Markup(
        '<path class="now" d="M0 {:.1f}V{:.1f}" transform="translate({:.0f})">'
        '<animateTransform attributeName="transform" type="translate" begin="{}.click" '
        'dur="{:.1f}s" values="0;{:.0f}"/></path>'
    ).format(top, height - LABELS, WIDTH, name, len(film.frames) * PERIOD_S, WIDTH)


def _x(film: Film, at_s: float) -> float:
    return WIDTH * at_s / max(film.duration_s, PERIOD_S)


def _text(x: float, y: float, text: str) -> Markup:
    return Markup('<text x="{:.1f}" y="{:.1f}">{}</text>').format(x, y, escape(text))
