"""The style sheet that all pages share: whole, harmless, and nothing loaded from elsewhere."""

from markupsafe import escape

from genpolicy.pages.style import page_style


def test_the_sheet_is_not_escaped_and_cannot_leave_its_element():
    style = page_style()
    assert escape(style) == style  # marked as safe, so that quotes and > stay
    assert "</style" not in style.lower() and "<script" not in style.lower()


def test_the_sheet_loads_nothing_and_its_braces_close():
    style = page_style()
    assert "@import" not in style and "http" not in style
    assert style.count("{") == style.count("}") > 10
