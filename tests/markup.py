"""What a checker of HTML says of a page, as far as the pages once got it wrong or easily would.

The Nu checker says more (`nu_checker.py`); these rules need nothing that is not here.
"""

from collections import Counter
from html.parser import HTMLParser

Attributes = list[tuple[str, str | None]]
VOID = {"meta", "link", "img", "br", "hr", "input", "col", "wbr"}
BLOCKS = {
    "p", "div", "ul", "ol", "dl", "table", "section", "figure", "details", "header", "footer",
    "nav", "main", "h1", "h2", "h3", "h4", "pre", "fieldset", "form", "aside", "article",
}  # fmt: skip
"""Begin a block: a paragraph that is open ends there, whatever was meant."""
PHRASES = {"p", "span", "b", "i", "em", "strong", "small", "code", "data", "label", "h1", "h2",
           "h3", "h4", "legend", "abbr", "sub", "sup"}  # fmt: skip
"""May hold words and no block."""
NAMELESS = {"div", "span", "p", "i", "b", "small", "code", "data"}
"""Have no role, so that a name in `aria-label` is read to nobody."""


class Markup(HTMLParser):
    """Walks a page.

    Attributes:
        wrong: What is wrong, with the line.
    """

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.wrong: list[str] = []
        self._open: list[tuple[str, list[str]]] = [("page", [])]
        self._names: Counter[str] = Counter()
        self._level = 0
        self._rows: list[list[int]] = []
        self._spans = [False]
        self.feed(text)
        self.close()
        self._say_if(len(self._open) > 1, f"{[tag for tag, _ in self._open[1:]]} stay open")
        for name, count in self._names.items():
            self._say_if(count > 1, f"id {name} stands {count} times")

    def _say_if(self, wrong: bool, what: str) -> None:
        if wrong:
            self.wrong.append(f"line {self.getpos()[0]}: {what}")

    def _begin(self, tag: str, attrs: Attributes) -> None:
        around, children = self._open[-1]
        children.append(tag)
        told = dict(attrs)
        self._names.update(value for name, value in attrs if name == "id" and value)
        self._say_if(len(told) < len(attrs), f"{tag} has an attribute twice")
        self._say_if(tag in BLOCKS and around in PHRASES, f"{tag} stands in {around}")
        self._say_if(tag == "img" and told.get("alt") is None, "a picture has no text")
        unheard = tag in NAMELESS and "aria-label" in told and "role" not in told
        self._say_if(unheard, f"{tag} has a name and no role")

    def handle_starttag(self, tag: str, attrs: Attributes) -> None:
        self._begin(tag, attrs)
        if len(tag) == 2 and tag[0] == "h" and tag[1].isdigit():
            level = int(tag[1])
            self._say_if(level > self._level + 1, f"{tag} follows h{self._level}")
            self._level = level
        if tag == "table":
            self._rows.append([])
            self._spans.append(False)
        if tag == "tr" and self._rows:
            self._rows[-1].append(0)
        if tag in ("td", "th") and self._rows and self._rows[-1]:
            told = dict(attrs)
            self._rows[-1][-1] += int(told.get("colspan") or 1)
            self._spans[-1] |= "rowspan" in told
        if tag not in VOID:
            self._open.append((tag, []))

    def handle_startendtag(self, tag: str, attrs: Attributes) -> None:
        self._begin(tag, attrs)

    def handle_endtag(self, tag: str) -> None:
        was, children = self._open.pop()
        self._say_if(was != tag, f"{tag} ends where {was} is open")
        if was == "figure" and "figcaption" in children:
            inner = "figcaption" in children[1:-1]
            self._say_if(inner, "a caption neither begins nor ends its figure")
        if was == "table":
            wide, spanned = set(self._rows.pop()), self._spans.pop()
            self._say_if(len(wide) > 1 and not spanned, f"rows of {sorted(wide)} cells in a table")
