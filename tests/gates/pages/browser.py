"""Pages in Chromium without a window: what is shown at a width, and on how many sheets."""

import html
import json
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

PATIENCE_S = 240.0
SHEET = re.compile(rb"/Type\s*/Page\b")
PAPER_PX = 718
"""Width between the margins of A4, the narrower of the usual two; one px is 1/96 inch."""
MEASURE = """
addEventListener('load', () => {
  const page = document.querySelector('iframe').contentDocument, view = page.defaultView
  const all = (which) => [...page.querySelectorAll(which)].filter(seen)
  const look = (one, part) => view.getComputedStyle(one, part)
  const seen = (one) => one.getClientRects().length > 0 && look(one).visibility != 'hidden'
  const wide = page.documentElement.clientWidth
  const name = (one) => `${one.tagName} ${one.textContent.trim().slice(0, 40)}`
  const size = (one) => {
    const way = one.getScreenCTM()
    return parseFloat(look(one).fontSize) * Math.sqrt(way.a * way.d - way.b * way.c)
  }
  const cut = (one) => one.clientWidth > 0 && one.scrollWidth > one.clientWidth + 1
  const out = (one) => {
    const box = one.getBoundingClientRect()
    return box.width > 0 && (box.right > wide + 1 || box.left < -1)
  }
  const said = (one) => {
    const note = look(one, '::before')
    return note.content != 'none' && parseFloat(note.paddingBottom) > 10
  }
  const boxes = all('body *').filter((one) => !one.ownerSVGElement || one.tagName == 'text')
  document.querySelector('pre').textContent = JSON.stringify({
    texts: all('svg text').map((one) => [size(one), one.textContent]),
    outside: boxes.filter(out).map(name),
    sideways: boxes.filter((one) => cut(one) && look(one).overflowX != 'visible').map(name),
    plots: all('.plot').filter(cut).map(name),
    unannounced: all('.plot').filter((one) => said(one) != cut(one)).map(name),
    moments: all('.moment').map((one) => one.getAttribute('style')),
    buttons: all('input').length,
    wide: page.documentElement.scrollWidth - wide,
  })
})
"""
SHOWN = """
addEventListener('load', () => {
  const page = document.querySelector('iframe').contentDocument
  const shown = [...page.images].map((one) => one.complete && one.naturalWidth > 0)
  document.querySelector('pre').textContent = JSON.stringify(shown)
})
"""


def chromium() -> str | None:
    """The browser's command, or None where it is not installed."""
    return next(filter(None, map(shutil.which, ("chromium", "chromium-browser"))), None)


def sheets(page: Path, folder: Path) -> int:
    """On how many sheets a page prints, at the browser's own paper size."""
    printed = folder / f"{page.stem}.pdf"
    _run(["--no-pdf-header-footer", f"--print-to-pdf={printed}", page.resolve().as_uri()])
    return len(SHEET.findall(printed.read_bytes()))


def measured(text: str, folder: Path, *, width_px: int, paper: bool = False) -> dict[str, Any]:
    """What of a page is shown at a width.

    Args:
        text: The page.
        folder: For what the browser is given to open.
        width_px: Of the screen or of the paper between its margins.
        paper: By the rules for paper instead of those for a screen.

    Returns:
        Size in px and words of each text of a drawing, what reaches outside the page, what is cut
        or scrolls sideways, plots that do, plots whose note on that is missing or stands without
        need, by how much the page as a whole is wider than the screen, px, and which moments and
        how many buttons of clips are seen.
    """
    text = re.sub(r"<meta http-equiv[^>]*>", "", text)
    if paper:
        text = text.replace("@media screen and", "@media print and").replace(
            "@media print{", "@media all{"
        )
    inner = html.escape(text, quote=True)
    opened = folder / "measured.html"
    opened.write_text(
        f'<!DOCTYPE html><iframe style="border:0;height:900px;width:{width_px}px" srcdoc="{inner}">'
        f"</iframe><pre></pre><script>{MEASURE}</script>"
    )
    said = _run(["--window-size=1200,1000", "--dump-dom", opened.resolve().as_uri()])
    found = re.search(r"<pre>(\{.*\})</pre>", said, flags=re.DOTALL)
    assert found, said[-2000:]
    return json.loads(html.unescape(found.group(1)))


def pictures(text: str, folder: Path) -> list[bool]:
    """Whether each picture of a page is shown, its own policy about content being in force."""
    inner, opened = html.escape(text, quote=True), folder / "pictures.html"
    opened.write_text(
        f'<!DOCTYPE html><iframe srcdoc="{inner}"></iframe><pre></pre><script>{SHOWN}</script>'
    )
    said = _run(["--dump-dom", opened.resolve().as_uri()])
    found = re.search(r"<pre>(\[.*\])</pre>", said)
    assert found, said[-2000:]
    return json.loads(found.group(1))


def _run(arguments: list[str]) -> str:
    command = chromium()
    assert command is not None
    flags = ["--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars"]
    done = subprocess.run(
        [command, *flags, *arguments], capture_output=True, timeout=PATIENCE_S, check=True
    )
    return done.stdout.decode()
