"""A rollout as a GIF: its film from above and from the side, with force and age under it.

What any page, message or slide shows without a viewer. The hand stands where it was commanded to
be, as in the film; the pictures are drawn from the journal, nobody filmed them.
"""

import io
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from genpolicy.replay.film import OBSTACLE, PERIOD_S, TARGET, Film, Frame, Outline
from genpolicy.replay.views import ABOVE, View, views_of
from genpolicy.tasks.api import Workspace

Array = NDArray[np.float64]
Colour = tuple[int, int, int]

WIDTH, GAP, STRIP, LINE = 640, 16, 56, 22
"""In pixels: of the picture, between the views, of a strip, of a line of text."""
FINER = 2
"""Drawn so many times larger and made smaller: edges without steps."""
LETTER = 13
SHADES = (0.3, 0.6)
"""Of a colour on the ground that it lies on: what an edge is made of."""
LAST_MS = 2000
"""How long the last picture stands before the film begins again, ms."""
PAPER: Colour = (255, 255, 255)
TABLE: Colour = (240, 241, 244)
LINES: Colour = (205, 209, 216)
SOFT: Colour = (86, 92, 104)
HAND: Colour = (91, 98, 112)
HELD: Colour = (217, 164, 65)
BLUE: Colour = (0, 103, 168)
RED: Colour = (180, 35, 24)
SCENE = {OBSTACLE: (141, 148, 161), TARGET: (127, 184, 162)}
NAMED = (PAPER, TABLE, LINES, SOFT, HAND, HELD, BLUE, RED, *SCENE.values())


@dataclass(frozen=True)
class Strip:
    """A quantity under the views.

    Attributes:
        title: What it is, with its unit.
        series: Time, s, and value.
        least: A strip is at least this high: a tremor of nothing must not fill it.
    """

    title: str
    series: Sequence[tuple[float, float]]
    least: float


def film_gif(film: Film, workspace: Workspace, *, said: str) -> bytes:
    """The bytes of a GIF; the same film gives the same bytes.

    Args:
        film: What to draw.
        workspace: What is shown.
        said: What it shows, written above it.
    """
    picture = _Picture(film, workspace, said)
    frames = [picture.drawn(number) for number in range(len(film.frames))]
    palette = Image.new("P", (1, 1))
    palette.putpalette([part for colour in _colours() for part in colour])
    first, *others = (frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames)
    step_ms = round(1000 * PERIOD_S)
    sink = io.BytesIO()
    first.save(
        sink, format="GIF", save_all=True, append_images=others, loop=0, optimize=False,
        duration=[*[step_ms] * len(others), LAST_MS],
    )  # fmt: skip
    return sink.getvalue()


def _colours() -> list[Colour]:
    """Every colour and its shades: a chosen palette would give a rare one away."""
    found = dict.fromkeys(NAMED)
    for colour in NAMED:
        for ground in (PAPER, TABLE):
            for shade in SHADES:
                mixed = np.round(shade * np.array(colour) + (1 - shade) * np.array(ground))
                found[tuple(int(part) for part in mixed)] = None  # type: ignore[index]
    return list(found)


class _Picture:
    """All that the pictures of a film have in common."""

    def __init__(self, film: Film, workspace: Workspace, said: str) -> None:
        self._film, self._said = film, said
        self._views = views_of(workspace, width=WIDTH * FINER, gap=GAP * FINER)
        self._top = LINE * FINER
        self._strips = (
            Strip("force, N", film.forces, 10.0),
            Strip("age of what conditioned the action, s", film.ages, 0.1),
        )
        self._below = self._top + max(view.height for view in self._views)
        high = self._below + FINER * (len(self._strips) * (STRIP + LINE) + LINE)
        self._size = (WIDTH * FINER, FINER * int(np.ceil(high / FINER)))
        self._font = ImageFont.load_default(LETTER * FINER)

    def drawn(self, number: int) -> Image.Image:
        """The picture of one frame."""
        image = Image.new("RGB", self._size, PAPER)
        draw, now_s = ImageDraw.Draw(image), min(number * PERIOD_S, self._film.duration_s)
        self._text(draw, 0.0, 0.0, self._said)
        for view, title in zip(self._views, ("from above", "from the side"), strict=True):
            self._view(draw, view, self._film.frames[number])
            self._text(draw, view.left + 4 * FINER, self._top + 2 * FINER, title)
        top = self._below
        for strip in self._strips:
            self._strip(draw, strip, top, now_s)
            top += (LINE + STRIP) * FINER
        phase, mode = _at(self._film.phases, now_s), _at(self._film.modes, now_s)
        self._text(draw, 0.0, top + 4 * FINER, f"{now_s:.1f} s   phase {phase}   {mode}")
        return image.resize((WIDTH, self._size[1] // FINER), Image.Resampling.LANCZOS)

    def _view(self, draw: ImageDraw.ImageDraw, view: View, frame: Frame) -> None:
        right = view.left + (WIDTH - GAP) * FINER / 2
        draw.rectangle((view.left, self._top, right, self._top + view.height), fill=TABLE)

        def polygon(outline: Outline, fill: Colour | None, edge: Colour) -> None:
            places = self._places(view, outline[view.side])
            draw.polygon(places, fill=fill, outline=edge)

        for kind, outline in frame.scene:
            polygon(outline, SCENE.get(kind), LINES)
        axes = [0, 1] if view.side == ABOVE else [0, 2]
        if len(self._film.path_m) > 1:
            draw.line(self._places(view, self._film.path_m[:, axes]), fill=BLUE, width=FINER)
        for part, fill in ((frame.held, HELD), (frame.hand, HAND)):
            if part is not None:
                polygon(part, fill, SOFT)

    def _places(self, view: View, outline: Array) -> list[tuple[float, float]]:
        """Places in the picture, kept within their view."""
        right = view.left + (WIDTH - GAP) * FINER / 2
        found = view.places(outline)
        found = np.clip(found, (view.left, 0.0), (right, view.height))
        return [(float(x), float(y + self._top)) for x, y in found]

    def _strip(self, draw: ImageDraw.ImageDraw, strip: Strip, top: float, now_s: float) -> None:
        most = max((value for _, value in strip.series), default=0.0)
        said = f"{strip.title}: at most {most:.3g}" if strip.series else f"{strip.title}: none"
        self._text(draw, 0.0, top + 4 * FINER, said)
        base, full = top + (LINE + STRIP) * FINER, max(most, strip.least)
        for at_s, value in strip.series:
            across = self._across(at_s)
            draw.line(
                (across, base, across, base - STRIP * FINER * value / full),
                fill=BLUE if at_s <= now_s else LINES,
                width=FINER,
            )
        draw.line((0, base, WIDTH * FINER, base), fill=SOFT, width=1)
        across = self._across(now_s)
        draw.line((across, base - STRIP * FINER, across, base), fill=RED, width=3 * FINER)

    def _across(self, at_s: float) -> float:
        return (WIDTH - 1) * FINER * at_s / max(self._film.duration_s, PERIOD_S)

    def _text(self, draw: ImageDraw.ImageDraw, x: float, y: float, text: str) -> None:
        draw.text((x, y), text, fill=SOFT, font=self._font)


def _at(marks: Sequence[tuple[float, str]], now_s: float) -> str:
    """What had begun last; empty before the first."""
    return next((name for at_s, name in reversed(marks) if at_s <= now_s), "")
