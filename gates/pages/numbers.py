"""What a page says of a criterion's numbers: against what, where judged, from which rows."""

from gates.readable import EVIDENCE, between, human
from gates.report import Answer, Recount
from gates.words import number, three

MOST_VALUES = 6
"""Of one column, in a sentence."""
SIGNS = {"<=": "≤", ">=": "≥"}


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


def recounted(recount: Recount) -> str:
    """How a number is counted again from its rows: filter, and what is counted or added up.

    `perturbation = nominal: 50 rows, of them success = true in 48`.
    """
    where = " and ".join(recount.where) or "all rows"
    if recount.of:
        total = f"{where}: {recount.of} adds up to {number(recount.whole)}"
        if recount.part is None:
            return total
        parts = " and ".join(recount.summed)
        adds = f"add{'' if len(recount.summed) > 1 else 's'} up to"
        return f"{total}, {parts} {adds} {number(recount.part)}"
    rows = f"{where}: {number(recount.whole)} row{'' if recount.whole == 1 else 's'}"
    if recount.part is None:
        return rows
    hits = " and ".join(map(_short, recount.hits))
    return f"{rows}, of them {hits} in {number(recount.part)}"


def _short(said: str) -> str:
    """A term with the first of many values: the file of the criteria has all."""
    first, *others = said.split(" or ")
    if len(others) < MOST_VALUES or said.startswith("not ("):
        return said
    return f"{first} or {len(others)} others that criteria.csv lists"


def beyond(answer: Answer) -> str:
    """How what does not hold stands to its limit; empty of what holds or has no number.

    `over by 0.8 points`, `short by 3 mm`, `the limit lies inside 35.6 to 50.8 %`.
    """
    found, limit = answer.measured, answer.threshold
    if found is None or limit is None or answer.verdict not in ("FAIL", "INCONCLUSIVE"):
        return ""
    if answer.verdict == "INCONCLUSIVE":
        return f"the limit lies inside {between(answer)}"
    if answer.id.endswith(EVIDENCE) and found > 0:
        return f"short by a factor of {three(limit / found)}"
    text = human(answer, abs(found - limit)).removeprefix("×")
    text = f"{text.removesuffix(' %')} points" if text.endswith(" %") else text
    return f"{'over' if answer.comparison == '<=' else 'short'} by {text}"
