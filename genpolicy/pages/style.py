"""The style sheet that all pages share."""

from importlib.resources import files

from markupsafe import Markup


def page_style() -> Markup:
    """The style sheet, for a `<style>` element."""
    return Markup((files("genpolicy.pages") / "style.css").read_text(encoding="utf-8"))
