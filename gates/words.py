"""Numbers in the sentences of criteria: three digits, percent with what they are of, ms and mm.

What is longer than a reader compares is shown by its beginning.
"""

import re

HASH = re.compile(r"[0-9a-f]{64}")
"""A SHA-256 in a text."""
SHOWN_HASH = 12
"""Characters of a hash that a reader compares; the file that is shown has all of it."""


def three(value: float) -> str:
    """Three digits that count, and no powers of ten where a person would write none."""
    rounded = float(f"{value:.3g}")
    return f"{rounded:,.0f}" if 1000 <= abs(rounded) < 1e9 else f"{value:.3g}"


def percent(share: float) -> str:
    """A share between 0 and 1 as percent: `96.4 %`."""
    return f"{three(100 * share)} %"


def points(gain: float) -> str:
    """A difference of two shares as points with its sign: `+41 points`."""
    return f"{'+' if gain >= 0 else '-'}{three(abs(100 * gain))} points"


def share_of(part: float, whole: float, what: str = "") -> str:
    """A share with what it was counted of: `96 % (48 of 50 rollouts)`, none of none is `none of 0`.

    Args:
        part: How many.
        whole: Of how many.
        what: The units; empty where they were just named.
    """
    counted = f"{number(part) if part else 'none'} of {number(whole)}"
    counted = f"{counted} {what}" if what else counted
    return f"{percent(part / whole)} ({counted})" if whole else counted


def number(count: float) -> str:
    """A count with its thousands apart: `1,080`."""
    return f"{count:,.0f}" if float(count).is_integer() else three(count)


def length(metres: float) -> str:
    """A length below a metre in mm."""
    return in_milli(metres, "m")


def duration(seconds: float) -> str:
    """A time below a second in ms."""
    return in_milli(seconds, "s")


def in_milli(value: float, unit: str) -> str:
    """A number with its unit; below 1 in thousandths of it."""
    small = abs(value) < 1 and value != 0
    return f"{three(1000 * value)} m{unit}" if small else f"{three(value)} {unit}"
