"""When a text names somebody; the checker has its own words for it, and they agree."""

import pytest

from genpolicy.contract.names import says
from genpolicy.verification.names import is_a_name

SAYS = ["ann", "Ümit Özdağ", "佐藤 花子", "R. 2", "7", "two\nlines\tof text", "O'Neil-Smith"]
SAYS_NOTHING = [
    "", " ", "-", "...", "\u200b", "\u00ad", "\u2060", "ann\u200b", "\u3164", "an\x00n", "\ue000",
    "\u202enna", None, 3, b"ann", ["ann"],
]  # fmt: skip


@pytest.mark.parametrize("text", SAYS)
def test_a_text_that_can_be_read_says_something(text):
    assert says(text) and is_a_name(text)


@pytest.mark.parametrize("text", SAYS_NOTHING, ids=repr)
def test_what_is_not_seen_or_no_text_says_nothing(text):
    assert not says(text) and not is_a_name(text)
