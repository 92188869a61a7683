"""Words of people on cards and lists: what is not seen, and what looks like something else.

A name decides nothing: ids and keys do. But a list of five entries is reviewed by eye, and one
person under five names that look alike would pass for five.
"""

import unicodedata

from genpolicy.contract.names import says

ALIKE = ("LATIN", "CYRILLIC", "GREEK", "ARMENIAN", "CHEROKEE")
"""Scripts with letters that look like those of another; no word has letters of two of them."""


def disguise(name: str) -> str:
    """Why a name may look like another one; empty if it is written as it looks.

    Not told is a name of one script that looks like one of another: whole words of both are names.
    """
    if not says(name):
        return "characters that are not seen, or nothing else"
    if unicodedata.normalize("NFKC", name) != name:
        return "letters in another form than the usual one (NFKC)"
    for word in name.split():
        scripts = {s for c in word if (s := unicodedata.name(c, "").partition(" ")[0]) in ALIKE}
        if len(scripts) > 1:
            return f"letters of {' and '.join(sorted(scripts)).lower()} in one word"
    return ""


def as_read(name: str) -> str:
    """A name as a hurried reader takes it: whatever its case, and however wide its spaces."""
    return " ".join(name.casefold().split())
