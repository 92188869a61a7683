"""Text for a terminal whose encoding lacks letters of it: escaped, not refused.

A report may hold any letter, and a terminal of an older locale has few. What it lacks is printed
as JSON escapes it, so that a document stays the same document.
"""

import codecs
import io
from collections.abc import Iterable
from typing import TextIO

ESCAPED = "genpolicy.escaped"


def _escaped(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    units = error.object[error.start : error.end].encode("utf-16-be", "surrogatepass")
    pairs = zip(units[::2], units[1::2], strict=True)
    return "".join(f"\\u{high:02x}{low:02x}" for high, low in pairs), error.end


codecs.register_error(ESCAPED, _escaped)


def escape_what_it_lacks(streams: Iterable[TextIO]) -> None:
    """Let streams that would refuse a letter escape it; one with a rule of its own keeps it.

    Args:
        streams: Standard output and standard error.
    """
    for stream in streams:
        if isinstance(stream, io.TextIOWrapper) and stream.errors == "strict":
            stream.reconfigure(errors=ESCAPED)
