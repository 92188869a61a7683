"""The summary in Markdown."""

import re

import pytest

from gates.pages.summary import plain


@pytest.mark.parametrize("text", ["a|b", "<b>", "@team", "`x`", "[l](u)", "two\nlines", "# h"])
def test_markdown_text_is_plain(text):
    out = plain(text)
    assert "\n" not in out and "<" not in out and "@" not in out
    assert not re.search(r"(?<!\\)[`|\[\]()#]", out.replace("&#64;", "").replace("&lt;", ""))
