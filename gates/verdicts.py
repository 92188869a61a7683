"""From numbers to verdicts: one criterion, one candidate, one gate.

Criteria are combined by intersection-union: every one must hold, so each is tested at full
level and no correction is needed. Nothing that is missing can pass.
"""

import math
from collections.abc import Iterable, Sequence

from gates.readable import found_text, limit_text
from gates.report import Answer, Comparison, GateReport, Overridden, Verdict

SEVERITY: dict[Verdict, int] = {"FAIL": 3, "INCONCLUSIVE": 2, "PENDING_REVIEW": 1, "PASS": 0}
SIGNIFICANT_DIGITS = 12


def rounded(value: float) -> float:
    """`value` to twelve significant digits: the same on every platform, before it is judged."""
    return float(f"{value:.{SIGNIFICANT_DIGITS}g}")


def margin(measured: float, limit: float, comparison: Comparison) -> float:
    """Distance to the limit; accepted where it is >= 0, so that NaN is not."""
    return limit - measured if comparison == "<=" else measured - limit


def judge_criterion(
    measured: float | None,
    limit: float | None,
    comparison: Comparison,
    interval: tuple[float, float] | None = None,
) -> Verdict:
    """Verdict of one criterion: shown to hold, shown to be broken, or neither.

    Args:
        measured: The number that must hold; the worse end of the interval, where there is one.
        limit: What it is held against.
        comparison: How it must stand to the limit.
        interval: What else the number may be, lower end first. A limit inside it is not shown to
            be broken: other episodes of the same truth would have met it.

    Returns:
        INCONCLUSIVE without a finite number on both sides, or where the limit is not met and the
        better end of the interval meets it.
    """
    if measured is None or limit is None:
        return "INCONCLUSIVE"
    if not (math.isfinite(measured) and math.isfinite(limit)):
        return "INCONCLUSIVE"
    if margin(measured, limit, comparison) >= 0:
        return "PASS"
    better = None if interval is None else interval[0 if comparison == "<=" else 1]
    return (
        "INCONCLUSIVE" if better is not None and margin(better, limit, comparison) >= 0 else "FAIL"
    )


def worst(verdicts: Iterable[Verdict]) -> Verdict:
    """The most severe verdict; INCONCLUSIVE if there is none."""
    return max(verdicts, key=SEVERITY.__getitem__, default="INCONCLUSIVE")


def best(verdicts: Iterable[Verdict]) -> Verdict:
    """The least severe verdict; INCONCLUSIVE if there is none."""
    return min(verdicts, key=SEVERITY.__getitem__, default="INCONCLUSIVE")


def at_most(verdict: Verdict, lacking: Sequence[str]) -> Verdict:
    """Nothing passes where something lacks, beside the criteria."""
    return "INCONCLUSIVE" if lacking and verdict == "PASS" else verdict


def combine(
    criteria: Sequence[Answer], *, expects_candidates: bool
) -> tuple[Verdict, dict[str, Verdict]]:
    """Verdict of a gate and of each candidate.

    A gate passes if and only if every gate-wide criterion passes and, where candidates are
    expected, at least one candidate passes all of its criteria.

    Args:
        criteria: Judged criteria.
        expects_candidates: Whether the gate is about candidates.
    """
    common = [c for c in criteria if c.candidate is None]
    parts: list[Verdict] = [c.verdict for c in common]
    names = sorted({c.candidate for c in criteria if c.candidate is not None})
    candidates = {name: worst(c.verdict for c in criteria if c.candidate == name) for name in names}
    if expects_candidates:
        parts.append(best(candidates.values()))
    return worst(parts), candidates


def first_unmet(criteria: Sequence[Answer], verdict: Verdict) -> Answer | None:
    """The criterion that decided: the first one, in order of diagnosis, with the gate's verdict.

    Criteria of candidates count only if no gate-wide one decides.
    """
    if verdict == "PASS":
        return None
    unmet = [c for c in criteria if c.verdict == verdict]
    common = [c for c in unmet if c.candidate is None]
    return next(iter(common or unmet), None)


def decided_by(report: GateReport) -> Answer | None:
    """The criterion that decided a report; none that somebody overrides decides anything.

    Returns:
        None after PASS, and where nothing was asked.
    """
    return first_unmet(counting(report), report.verdict)


def decided_text(report: GateReport) -> str:
    """The criterion that decided, in one phrase; empty after PASS."""
    decided = decided_by(report)
    if decided is None:
        return ""
    of = f" ({decided.candidate})" if decided.candidate else ""
    return f"{decided.id}{of}: {found_text(decided)}, required {limit_text(decided)}"


def stopping(report: GateReport) -> dict[str, list[Answer]]:
    """For each candidate that does not pass: what counts and has its verdict, in the order asked.

    Of one that passes, nothing.
    """
    answers = counting(report)
    return {
        name: [c for c in answers if c.candidate == name and c.verdict == verdict != "PASS"]
        for name, verdict in report.candidates.items()
    }


def counting(report: GateReport) -> list[Answer]:
    """Criteria by which the verdict is found, each with the verdict that counts.

    Left out is what holds by a looser limit only; what is not decided by it counts as such.
    """
    found = []
    for answer in report.criteria:
        entry = overridden_here(answer, report)
        instead = answer.verdict if entry is None or entry.instead is None else entry.instead
        if answer.verdict == "PASS" or instead != "PASS":
            kept = instead == answer.verdict
            found.append(answer if kept else answer.model_copy(update={"verdict": instead}))
    return found


def overridden_here(answer: Answer, report: GateReport) -> Overridden | None:
    """The exception that a criterion is held to; None where it counts by its own limit."""
    key = (report.gate, answer.id, answer.candidate)
    own = (one for one in report.overrides if (one.gate, one.criterion, one.candidate) == key)
    return next(own, None)
