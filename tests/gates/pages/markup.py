"""What a checker of HTML says of a page, as far as the pages once got it wrong."""

from collections import Counter
from html.parser import HTMLParser

VOID = {"meta", "link", "img", "br", "hr", "input", "col", "wbr"}


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
        self.feed(text)
        self.close()
        self._say_if(len(self._open) > 1, f"{[tag for tag, _ in self._open[1:]]} stay open")
        for name, count in self._names.items():
            self._say_if(count > 1, f"id {name} stands {count} times")

    def _say_if(self, wrong: bool, what: str) -> None:
        if wrong:
            self.wrong.append(f"line {self.getpos()[0]}: {what}")

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self._open[-1][1].append(tag)
        self._names.update(value for name, value in attrs if name == "id" and value)
        if len(tag) == 2 and tag[0] == "h" and tag[1].isdigit():
            level = int(tag[1])
            self._say_if(level > self._level + 1, f"{tag} follows h{self._level}")
            self._level = level
        if tag not in VOID:
            self._open.append((tag, []))

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self._open[-1][1].append(tag)
        self._names.update(value for name, value in attrs if name == "id" and value)

    def handle_endtag(self, tag: str) -> None:
        was, children = self._open.pop()
        self._say_if(was != tag, f"{tag} ends where {was} is open")
        if was == "figure" and "figcaption" in children:
            inner = "figcaption" in children[1:-1]
            self._say_if(inner, "a caption neither begins nor ends its figure")
