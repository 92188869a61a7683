"""The criteria as a reader needs them: grouped, counted, and what failed without deciding."""

from dataclasses import dataclass
from itertools import groupby

from gates.pages.numbers import limit_said
from gates.readable import found_text, human
from gates.report import Answer, GateReport
from gates.settings import WAIVED
from gates.verdicts import counting, decided_by, overridden_here, stopping


@dataclass(frozen=True)
class Line:
    """One judged criterion in the table.

    Attributes:
        criterion: What was judged.
        waived: Why it does not count although it is not met; empty if it counts.
        overridden: Who holds it to another limit; empty where nobody does.
    """

    criterion: Answer
    waived: str
    overridden: str = ""


@dataclass(frozen=True)
class Group:
    """One question, with a line for the gate or one for each candidate.

    Attributes:
        evidence: Files that were read for any of its numbers, each once.
    """

    question: str
    id: str
    reason: str
    owner: str
    lines: tuple[Line, ...]
    evidence: tuple[str, ...]

    @property
    def holds(self) -> bool:
        """Whether every line of it does, so that nobody has to look first."""
        return all(line.criterion.verdict == "PASS" for line in self.lines)

    def of(self, candidate: str) -> Line | None:
        """The line of a candidate, or of the gate; None where it was not asked."""
        own = (line for line in self.lines if line.criterion.candidate in (None, candidate))
        return next(own, None)


def columns(report: GateReport) -> list[str]:
    """Candidates that a criterion speaks of, in the order in which it does."""
    return list(dict.fromkeys(c.candidate for c in report.criteria if c.candidate is not None))


def groups(report: GateReport) -> list[Group]:
    """Criteria by question, in the order of diagnosis."""
    found = []
    for name, members in groupby(report.criteria, key=lambda c: c.id):
        same = list(members)
        first = same[0]
        lines = tuple(Line(c, waived(c, report), overridden(c, report)) for c in same)
        found.append(
            Group(
                first.question,
                name,
                first.reason,
                first.owner or "nobody",
                lines,
                tuple(dict.fromkeys(path for c in same for path in c.evidence)),
            )
        )
    return found


def waived(criterion: Answer, report: GateReport) -> str:
    """Why an unmet criterion does not stand in the way; empty if it does."""
    if criterion.verdict != "FAIL" or overridden_here(criterion, report):
        return ""
    if criterion.candidate is not None and report.verdict == "PASS":
        return f"stops {criterion.candidate} only"
    return ""


def overridden(criterion: Answer, report: GateReport) -> str:
    """Who holds a criterion to another limit than its own, and until when; empty if nobody does."""
    entry = overridden_here(criterion, report)
    if entry is None:
        return ""
    limit = f"{sign(entry.comparison)} {human(criterion, entry.limit)}"
    return f"overridden: {entry.instead} by {limit}, by {entry.by} until {entry.expires}"


def not_asked(report: GateReport) -> tuple[str, ...]:
    """What was left unasked, and who answers for it: it stands above what holds."""
    return tuple(caveat for caveat in report.caveats if WAIVED.match(caveat))


def tally(report: GateReport) -> str:
    """How many criteria hold, and what the others are, in one sentence."""
    texts = [f"{_count(report, 'PASS')} of {len(report.criteria)} hold"]
    if failing := _count(report, "FAIL"):
        spared = sum(bool(waived(c, report)) for c in report.criteria)
        who = "" if spared == failing else f"{spared} of them "
        aside = f" ({who}without weight for the verdict)" if spared else ""
        texts.append(f"{failing} {'fails' if failing == 1 else 'fail'}{aside}")
    # What was measured and is not decided has an interval; what was not measured has nothing.
    unsure = [c for c in report.criteria if c.verdict == "INCONCLUSIVE"]
    if undecided := sum(c.interval is not None for c in unsure):
        texts.append(f"{undecided} not decided")
    if absent := len(unsure) - undecided:
        texts.append(f"{absent} not measured")
    if waiting := _count(report, "PENDING_REVIEW"):
        texts.append(f"{waiting} {'waits' if waiting == 1 else 'wait'} for a person")
    if excepted := sum(bool(overridden(c, report)) for c in report.criteria):
        texts.append(f"{excepted} overridden")
    return "; ".join(texts)


def _count(report: GateReport, verdict: str) -> int:
    return sum(c.verdict == verdict for c in report.criteria)


def deciding(report: GateReport) -> str:
    """What decided a verdict other than PASS, in one phrase; empty after PASS."""
    decided = decided_by(report)
    if decided is None:
        return ""
    of = f" of {decided.candidate}" if decided.candidate else ""
    return f"{decided.id}{of}: {against(decided)}"


def against(criterion: Answer) -> str:
    """Measured against required, as a person reads numbers."""
    return f"{found_text(criterion)}, required {limit_said(criterion)}"


def stops(report: GateReport) -> dict[str, str]:
    """For each candidate that does not pass: the first criterion that it does not meet."""
    return {
        name: f"{unmet[0].id}: {against(unmet[0])}" if unmet else ""
        for name, unmet in stopping(report).items()
    }


def passed_by(report: GateReport) -> str:
    """What a PASS rests on, in one phrase; empty for other verdicts."""
    if report.verdict != "PASS":
        return ""
    text = "every required criterion holds"
    if len(counting(report)) < len(report.criteria):
        text += " but those that are overridden"
    names = sorted(name for name, verdict in report.candidates.items() if verdict == "PASS")
    if names:
        text += f"; {', '.join(names)} {'pass' if len(names) > 1 else 'passes'} whole"
    return text


def sign(text: str) -> str:
    """Comparisons as a reader writes them."""
    return text.replace("<=", "≤").replace(">=", "≥")
