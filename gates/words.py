"""Numbers in the sentences of criteria: three digits, percent with what they are of, ms and mm.

What is longer than a reader compares is shown by its beginning.
"""

import re

HASH = re.compile(r"[0-9a-f]{64}")
"""A SHA-256 in a text."""
DIGITS = 3
"""Of a number that a person reads; the JSON of a report has all."""
SHOWN_HASH = 12
"""Characters of a hash that a reader compares; the file that is shown has all of it."""
NEXT = "Next: "
"""Begins the last sentence of a diagnosis that knows what to do."""


def advice_of(diagnosis: str) -> str:
    """What a diagnosis says to do next, with the word that says so; empty where it says nothing."""
    _, said, advice = diagnosis.rpartition(NEXT)
    return said + advice if said else ""


def three(value: float, *, digits: int = DIGITS) -> str:
    """Three digits that count, and no powers of ten where a person would write none.

    Args:
        value: The number.
        digits: More of them, where two numbers that differ are to look different.
    """
    rounded = float(f"{value:.{digits}g}")
    if not 1000 <= abs(rounded) < 1e9:
        return f"{value:.{digits}g}"
    return f"{rounded:,}".removesuffix(".0")


def percent(share: float, *, digits: int = DIGITS) -> str:
    """A share between 0 and 1 as percent: `96.4 %`."""
    return f"{three(100 * share, digits=digits)} %"


def span(low: str, high: str) -> str:
    """From one number to another, a unit that both have said once: `35.6 to 50.8 %`."""
    alone, _, unit = low.partition(" ")
    return f"{alone if unit and high.endswith(f' {unit}') else low} to {high}"


def percents(low: float, high: float) -> str:
    """An interval of a share, its unit said once: `28.7 to 68.1 %`."""
    return span(percent(low), percent(high))


def share_between(share: float, low: float, high: float) -> str:
    """A share and its interval: `48.1 % (28.7 to 68.1)`."""
    return f"{percent(share)} ({three(100 * low)} to {three(100 * high)})"


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


def number(count: float, *, digits: int = DIGITS) -> str:
    """A count with its thousands apart: `1,080`."""
    return f"{count:,.0f}" if float(count).is_integer() else three(count, digits=digits)


def length(metres: float) -> str:
    """A length below a metre in mm."""
    return in_milli(metres, "m")


def duration(seconds: float) -> str:
    """A time below a second in ms."""
    return in_milli(seconds, "s")


def in_milli(value: float, unit: str, *, digits: int = DIGITS) -> str:
    """A number with its unit; below 1 in thousandths of it."""
    small = abs(value) < 1 and value != 0
    scaled, prefix = (1000 * value, "m") if small else (value, "")
    return f"{three(scaled, digits=digits)} {prefix}{unit}"
