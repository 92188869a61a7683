"""When a text names somebody; the checker has its own words for it, and they agree."""

import sys

import pytest
import regex

from genpolicy.contract.names import says
from genpolicy.verification.names import is_a_name

SAYS = ["ann", "Ümit Özdağ", "佐藤 花子", "R. 2", "7", "two\nlines\tof text", "O'Neil-Smith"]
SAYS_NOTHING = [
    "", " ", "-", "...", "\u200b", "\u00ad", "\u2060", "ann\u200b", "\u3164", "an\x00n", "\ue000",
    "\u202enna", "a\u034fnn", "ann\ufe0f", "ann\U000e0100", "ann\U000e01ef", "ann\u180b",
    "ann\u180f", "ann\u17b4", "ann\u17b5", "ann \u2800", "\u2800", "ann\U0001d159", "ann\U00016fe4",
    None, 3, b"ann", ["ann"],
]  # fmt: skip


@pytest.mark.parametrize("text", SAYS)
def test_a_text_that_can_be_read_says_something(text):
    assert says(text) and is_a_name(text)


@pytest.mark.parametrize("text", SAYS_NOTHING, ids=repr)
def test_what_is_not_seen_or_no_text_says_nothing(text):
    assert not says(text) and not is_a_name(text)


def test_what_unicode_has_drawn_as_nothing_says_nothing():
    """All of its plane, by the library that knows the property; what is unassigned as well."""
    ignored = regex.compile(r"\p{Default_Ignorable_Code_Point}")
    unseen = [c for c in map(chr, range(sys.maxunicode + 1)) if ignored.match(c)]
    assert len(unseen) > 4000
    assert not [hex(ord(c)) for c in unseen if says(f"ann{c}") or is_a_name(f"ann{c}")]
