"""Who a journal says it was: a name that a person can read."""

import unicodedata

FILLERS = {"\u115f", "\u1160", "\u2800", "\u3164", "\uffa0", "\U00016fe4", "\U0001d159"}
"""They count as letters, marks or symbols, and have no shape."""
SELECTORS = {
    *map(chr, range(0x180B, 0x1810)),
    *map(chr, range(0xFE00, 0xFE10)),
    *map(chr, range(0xE0100, 0xE01F0)),
}
"""They choose how the character before them is drawn, and are not drawn themselves."""
UNDRAWN = FILLERS | SELECTORS | {"\u034f", "\u17b4", "\u17b5"}
"""With the joiner of graphemes, and two vowels of Khmer that are never written."""


def is_a_name(value: object) -> bool:
    """Whether a value of a journal is a text with a letter or a digit, and nothing unseen in it."""
    if not isinstance(value, str) or UNDRAWN & set(value):
        return False
    drawn = value.replace("\n", "").replace("\t", "")
    unseen = any(unicodedata.category(character).startswith("C") for character in drawn)
    return not unseen and any(character.isalnum() for character in drawn)
