"""Whom the desk is about: one reads of the candidate that is asked about, and of no other."""

from collections.abc import Collection, Mapping

from gates.doubt import Doubt
from gates.doubts import about_others, about_these, of_a_ladder
from gates.report import GATES, Answer, Gate, GateReport


def asked_about(reports: Mapping[Gate, GateReport]) -> tuple[str, ...]:
    """Candidates that the ladder still asks about, by name; none where no gate has any.

    The one that Gate D promotes; until it does, those that no gate has stopped. Where a gate stops
    all that came to it, those are meant: of them one reads why.

    Args:
        reports: By gate.
    """
    if "D" in reports and reports["D"].promoted:
        return (reports["D"].promoted,)
    remaining: set[str] = set()
    for report in (reports[gate] for gate in GATES if gate in reports):
        came = remaining & report.candidates.keys() or set(report.candidates)
        passing = {name for name in came if report.candidates[name] == "PASS"}
        remaining = passing or came or remaining
        if report.verdict != "PASS":
            break
    return tuple(sorted(remaining))


def answers_about(report: GateReport, about: Collection[str]) -> list[Answer]:
    """Criteria of the whole gate and of these candidates; of all if it knows none of them.

    Args:
        report: Of one gate.
        about: Names of candidates.
    """
    return [c for c in report.criteria if c.candidate in (None, *_known(report, about))]


def doubts_about(
    reports: Mapping[Gate, GateReport], about: Collection[str]
) -> tuple[tuple[Doubt, ...], tuple[Doubt, ...], tuple[Doubt, ...]]:
    """What could be wrong, and of whom: what is said of others is not lost, and hides nothing.

    Args:
        reports: By gate.
        about: Names of candidates.

    Returns:
        What a reader weighs and what no gate shows, as `of_a_ladder` has them, of the whole gates,
        of these candidates and of what stopped others; then both about others.
    """
    present = [reports[gate] for gate in GATES if gate in reports]
    doubts, not_shown = of_a_ladder(about_these(r, _known(r, about)) for r in present)
    weighed, behind = of_a_ladder(about_others(r, _known(r, about)) for r in present)
    return tuple(doubts), tuple(not_shown), (*weighed, *behind)


def _known(report: GateReport, about: Collection[str]) -> set[str]:
    """Those of these candidates that a report judges; all of its own where it judges none."""
    return {name for name in about if name in report.candidates} or set(report.candidates)
