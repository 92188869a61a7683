"""Numbers of a report as a person reads them: percent, ms, mm, three digits; and where judged.

The unit stands in the criterion's name, and its limit says whether it is a share.
"""

import re

from gates.pages.guide import unit
from gates.report import Answer

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
)
"""How names of shares end."""
SIGNS = {"<=": "≤", ">=": "≥"}


def human(answer: Answer, value: float | None) -> str:
    """A number in the unit that a person uses: ms, mm, percent; three digits.

    Args:
        answer: The criterion, whose name says the unit and whose limit says whether it is a share.
        value: The number; None is "not measured".
    """
    if value is None:
        return "not measured"
    suffix = unit(answer.id)
    if suffix in ("s", "m") and abs(value) < 1 and value != 0:
        return f"{_three(1000 * value)} m{suffix}"
    if suffix:
        return f"{_three(value)} {suffix}"
    if "ratio" in answer.id:
        return f"×{_three(value)}"
    if answer.id.endswith(RATES) and answer.threshold is not None and answer.threshold <= 1:
        return f"{_three(100 * value)} %"
    return _three(value) if value != int(value) else f"{int(value):,}"


def limit_said(answer: Answer) -> str:
    """The limit with its comparison."""
    if answer.threshold is None:
        return "no limit"
    return f"{SIGNS[answer.comparison]} {human(answer, answer.threshold)}"


def at_its_end(answer: Answer) -> str:
    """What was measured; with the side of the interval on which it was judged."""
    text, where = human(answer, answer.measured), judged_at(answer)
    if not where.endswith("end"):
        return text
    upper = (where == "the worse end") == (answer.comparison == "<=")
    return f"{'at most' if upper else 'at least'} {text}"


def judged_at(answer: Answer) -> str:
    """What was held against the limit: a point, or an end of the interval; empty of nothing.

    The worse end is the one that is farther from what is asked for.
    """
    if answer.measured is None:
        return ""
    if answer.interval is None:
        return "a point"
    low, high = answer.interval
    worse, better = (high, low) if answer.comparison == "<=" else (low, high)
    if answer.measured == worse:
        return "the worse end"
    return "the better end" if answer.measured == better else "a point of its interval"


def rests_on(counted: str) -> str:
    """What a number counts, for a reader: `none of 1,080 arrivals`."""
    text = re.sub(r"^0 of ", "none of ", counted)
    return re.sub(r"\d{4,}", lambda found: f"{int(found[0]):,}", text)


def _three(value: float) -> str:
    """Three digits that count, and no powers of ten where a person would write none."""
    rounded = float(f"{value:.3g}")
    return f"{rounded:,.0f}" if 1000 <= abs(rounded) < 1e9 else f"{value:.3g}"
