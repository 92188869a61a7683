"""When a text names somebody: it can be read, and nothing in it is there unseen."""

import unicodedata

BLANK = "\u115f\u1160\u3164\uffa0"
"""Letters by their category, and fillers without a shape."""


def says(text: object) -> bool:
    """Whether it is a text that holds a letter or a digit, and nothing that is not seen."""
    if not isinstance(text, str):
        return False
    seen = [character for character in text if character not in "\n\t"]
    kinds = {"Cf" if c in BLANK else unicodedata.category(c) for c in seen}
    return any(kind[0] in "LN" for kind in kinds) and not kinds & {"Cf", "Cc", "Co", "Cn", "Cs"}
