"""When a text names somebody: it can be read, and nothing in it is there unseen."""

import unicodedata

BLANK = "\u115f\u1160\u2800\u3164\uffa0\U0001d159\U00016fe4"
"""Letters, marks and symbols by their category, and fillers without a shape."""
IGNORED = (
    (0x034F, 0x034F),
    (0x17B4, 0x17B5),
    (0x180B, 0x180F),
    (0xFE00, 0xFE0F),
    (0xE0100, 0xE01EF),
)
"""Marks that Unicode has drawn as nothing (Default_Ignorable_Code_Point), first and last.

Joiners, vowels that are inherent, selectors of a variant. What is ignored of other categories is
told by them.
"""


def says(text: object) -> bool:
    """Whether it is a text that holds a letter or a digit, and nothing that is not seen."""
    if not isinstance(text, str):
        return False
    kinds = {_kind(character) for character in text if character not in "\n\t"}
    return any(kind[0] in "LN" for kind in kinds) and not kinds & {"Cf", "Cc", "Co", "Cn", "Cs"}


def _kind(character: str) -> str:
    unseen = any(first <= ord(character) <= last for first, last in IGNORED)
    return "Cf" if unseen or character in BLANK else unicodedata.category(character)
