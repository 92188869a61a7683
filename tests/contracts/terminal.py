"""What a terminal shows, as a picture of text: the colours of its escape codes, light or dark."""

import re
from collections.abc import Iterator
from html import escape

COLUMNS = 80
WIDE, HIGH = 8.4, 20
"""Of a character and a line, px: a fixed font of 14 px is 0.6 em wide."""
EDGE = 14
"""Around the text, px."""
CODE = re.compile(r"\x1b\[(\d+)m")
NAMES = {"0": "", "31": "red", "32": "green", "33": "yellow"}
"""Class of a text by the code before it, of those that the tables use."""
LIGHT = {"ground": "#f6f7f9", "ink": "#1f2430", "red": "#a8330a", "green": "#00664c",
         "yellow": "#6e4f00"}  # fmt: skip
DARK = {"ground": "#14171d", "ink": "#e8eaf0", "red": "#f08a52", "green": "#4fc79b",
        "yellow": "#dcb54a"}  # fmt: skip


def drawn(lines: list[str], *, title: str) -> str:
    """The picture of some lines, escape codes and all.

    Args:
        lines: As a program prints them on a terminal.
        title: What the picture is of, for who does not see it.

    Raises:
        ValueError: A line is wider than the terminal.
        KeyError: A code of no colour that is known here.
    """
    for line in lines:
        if len(plain(line)) > COLUMNS:
            raise ValueError(f"{len(plain(line))} columns, expected at most {COLUMNS}: {line}")
    wide, high = round(COLUMNS * WIDE + 2 * EDGE), HIGH * len(lines) + 2 * EDGE
    rows = (
        f'<text x="{EDGE}" y="{EDGE + HIGH * (n + 1) - 6}">{"".join(_spans(line))}</text>'
        for n, line in enumerate(lines)
    )
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {wide} {high}" role="img" '
            f'aria-labelledby="t" font-family="ui-monospace, Menlo, Consolas, monospace" '
            f'font-size="14">',
            f'<title id="t">{escape(title)}</title>',
            f"<style>{_style(LIGHT)}@media(prefers-color-scheme:dark){{{_style(DARK)}}}</style>",
            f'<rect class="ground" width="{wide}" height="{high}" rx="8"/>',
            *rows,
            "</svg>\n",
        ]
    )


def plain(line: str) -> str:
    """A line without its escape codes."""
    return CODE.sub("", line)


def _spans(line: str) -> Iterator[str]:
    """The pieces of a line, each as wide as its characters whatever font draws it."""
    column, colour = 0, ""
    for place, piece in enumerate(CODE.split(line)):
        if place % 2:
            colour = NAMES[piece]
        elif piece:
            kind = f' class="{colour}"' if colour else ""
            at, length = EDGE + WIDE * column, WIDE * len(piece)
            yield (
                f'<tspan{kind} x="{at:.1f}" textLength="{length:.1f}" xml:space="preserve">'
                f"{escape(piece, quote=False)}</tspan>"
            )
            column += len(piece)


def _style(colours: dict[str, str]) -> str:
    inks = "".join(f".{name}{{fill:{colours[name]}}}" for name in NAMES.values() if name)
    return f".ground{{fill:{colours['ground']}}}text{{fill:{colours['ink']}}}{inks}"
