"""When a text names somebody; the checker has its own words for it, and they agree."""

import pytest

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


IGNORED = (
    (0xAD, 0xAD), (0x34F, 0x34F), (0x61C, 0x61C), (0x115F, 0x1160), (0x17B4, 0x17B5),
    (0x180B, 0x180F), (0x200B, 0x200F), (0x202A, 0x202E), (0x2060, 0x206F), (0x3164, 0x3164),
    (0xFE00, 0xFE0F), (0xFEFF, 0xFEFF), (0xFFA0, 0xFFA0), (0xFFF0, 0xFFF8), (0x1BCA0, 0x1BCA3),
    (0x1D173, 0x1D17A), (0xE0000, 0xE0FFF),
)  # fmt: skip
"""Default_Ignorable_Code_Point of Unicode (DerivedCoreProperties), first and last, all of it."""


def test_what_unicode_has_drawn_as_nothing_says_nothing():
    """What is not assigned yet as well."""
    unseen = [chr(code) for first, last in IGNORED for code in range(first, last + 1)]
    assert len(unseen) == 4174
    assert not [hex(ord(c)) for c in unseen if says(f"ann{c}") or is_a_name(f"ann{c}")]
