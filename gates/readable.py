"""Numbers of a criterion as a person reads them, on pages and in a terminal: percent, ms, mm.

The unit stands in the criterion's name, and its limit says whether it is a share. All digits
stand in the JSON of the report.
"""

import math
import re

from gates.report import Answer
from gates.words import DIGITS, in_milli, number, percent, span, three

RATES = (
    "_share",
    "_lower",
    "_upper",
    "_margin",
    "_disagreement",
    "_coverage",
    "_deviation",
    "_gap",
    "_reachable",
    "_effect",
)
"""How names of shares end."""
RATIO = "_ratio"
"""In names of criteria that are held against no change, which is 1."""
EVIDENCE = "_e_value"
"""How names of evidence end: so much to 1."""
UNITS: tuple[tuple[str, str], ...] = (
    ("_m_s3", "m/s³"),
    ("_m_s", "m/s"),
    ("lag_spread_rows", "action steps"),
    ("_s", "s"),
    ("_m", "m"),
    ("_n", "N"),
)
NO_SHARE = 1e9
"""Percent from which on a limit of a share is one in name only, as rehearsals have; spelled out."""
MOST_TYPED = 6
"""Digits of a limit that somebody typed; one that is derived, like 1 / alpha, may have more."""
MOST_DIGITS = 12
"""Of a number when it is judged."""


def unit(criterion: str) -> str:
    """Unit of a criterion by the suffix of its name; empty for counts, shares and ratios."""
    return next((text for suffix, text in UNITS if criterion.endswith(suffix)), "")


def human(answer: Answer, value: float | None) -> str:
    """A number in the unit that a person uses: ms, mm, percent; three digits.

    More, where three would make what differs from the limit look like the limit: nobody believes
    `50 %, required <= 50 %: FAIL`.

    Args:
        answer: The criterion, whose name says the unit and whose limit says whether it is a share.
        value: The number, or its limit; None is "not measured".
    """
    if value is None:
        return "not measured"
    limit = answer.threshold
    if limit is None:
        return _in_unit(answer, value, DIGITS)
    held = _in_unit(answer, limit, _typed(limit))
    if value == limit:
        return held
    told = (_in_unit(answer, value, digits) for digits in range(DIGITS, MOST_DIGITS + 1))
    return next((text for text in told if text != held), held)


def measured_text(answer: Answer) -> str:
    """What was measured, for a sentence."""
    return (
        "pending review" if answer.verdict == "PENDING_REVIEW" else human(answer, answer.measured)
    )


def found_text(answer: Answer, *, of_how_many: bool = True) -> str:
    """What was held against a limit, and of how many, for a sentence.

    Of what is not decided the interval: its worse end alone looks like a limit that is broken.
    """
    undecided = answer.verdict == "INCONCLUSIVE" and answer.measured is not None
    text = between(answer) if undecided and answer.interval else measured_text(answer)
    return text + (of_units(answer) if of_how_many else "")


def of_units(answer: Answer) -> str:
    """Of how many a number is, in brackets behind it; empty where it counts none."""
    over = "over " if answer.counted.startswith("all ") else ""
    return f" ({over}{rests_on(answer.counted)})" if answer.counted else ""


def rests_on(counted: str) -> str:
    """What a number counts, for a reader: `none of 1,080 arrivals`."""
    text = re.sub(r"^0 of ", "none of ", counted)
    return re.sub(r"\d{4,}", lambda found: f"{int(found[0]):,}", text)


def limit_text(answer: Answer) -> str:
    """The limit, for a sentence in a terminal."""
    if answer.threshold is None:
        return "a limit in params.yaml"
    return f"{answer.comparison} {human(answer, answer.threshold)}"


def between(answer: Answer) -> str:
    """An interval, its unit said once: `35.6 to 50.8 %`; empty where there is none."""
    if answer.interval is None:
        return ""
    low, high = answer.interval
    return span(human(answer, low), human(answer, high))


def _typed(limit: float) -> int:
    """As many digits as a limit has."""
    for digits in range(DIGITS, MOST_TYPED + 1):
        if math.isclose(float(f"{limit:.{digits}g}"), limit, rel_tol=1e-12):
            return digits
    return DIGITS


def _in_unit(answer: Answer, value: float, digits: int) -> str:
    suffix = unit(answer.id)
    if suffix in ("s", "m"):
        return in_milli(value, suffix, digits=digits)
    text = three(value, digits=digits)
    if suffix:
        return f"{text} {suffix.removesuffix('s') if text == '1' else suffix}"
    if answer.id.endswith(EVIDENCE) or RATIO in answer.id:
        return f"×{text}" if RATIO in answer.id else f"{text} to 1"
    if answer.id.endswith(RATES) and answer.threshold is not None:
        loose = abs(100 * value) >= NO_SHARE
        return f"{100 * value:,.0f} %" if loose else percent(value, digits=digits)
    return number(value, digits=digits)
