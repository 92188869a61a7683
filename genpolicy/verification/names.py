"""Who a journal says it was: a name that a person can read."""

import unicodedata

FILLERS = {"\u115f", "\u1160", "\u3164", "\uffa0"}
"""They count as letters and have no shape."""


def is_a_name(value: object) -> bool:
    """Whether a value of a journal is a text with a letter or a digit, and nothing unseen in it."""
    if not isinstance(value, str) or FILLERS & set(value):
        return False
    drawn = value.replace("\n", "").replace("\t", "")
    unseen = any(unicodedata.category(character).startswith("C") for character in drawn)
    return not unseen and any(character.isalnum() for character in drawn)
