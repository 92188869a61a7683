"""What moved between two runs of the ladder, and why it may have: read from their reports.

A verdict that turned is half of an answer. The other half is whether limits, code, parameters or
evidence moved with it, so that nobody takes a moved limit for a better policy.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from gates.overrides import OVERRIDDEN, is_said
from gates.readable import between, limit_text, measured_text
from gates.report import GATES, NAMES, Answer, Gate, GateReport

NOT_JUDGED = "NOT JUDGED"
MOST_NAMED = 6
"""Keys that one line names; of more it says how many there are."""
SOURCES = ("code", "parameters", "materials", "pipeline", "settings", "environment", "upstream")
"""Fields of a report that can explain a difference, the likeliest cause first."""


@dataclass(frozen=True)
class Turned:
    """One criterion that differs.

    Attributes:
        criterion: Its name, with the candidate in brackets.
        kind: `turned` (another verdict), `limit` (loosened, tightened or changed), `number`,
            `added`, `gone`.
        before: What the first report says; empty where it does not ask.
        after: What the second says.
    """

    criterion: str
    kind: str
    before: str
    after: str


@dataclass(frozen=True)
class Moved:
    """What differs between two reports of one gate.

    Attributes:
        gate: Its letter.
        before: First verdict.
        after: Second verdict.
        criteria: Criteria that differ, those whose verdict turned first.
        sources: What differs below them, by field of the report: keys in order.
        caveats: Caveats that came (`+ ...`) and went (`- ...`).
    """

    gate: Gate
    before: str
    after: str
    criteria: tuple[Turned, ...] = ()
    sources: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    caveats: tuple[str, ...] = ()

    @property
    def same(self) -> bool:
        """Whether nothing moved at all."""
        moved = self.criteria or self.sources or self.caveats
        return self.before == self.after and not moved


def moved(before: Mapping[Gate, GateReport], after: Mapping[Gate, GateReport]) -> list[Moved]:
    """Per gate that either run judged, what moved from the first to the second.

    Args:
        before: Reports of the first run, by gate.
        after: Reports of the second.
    """
    return [
        _of_gate(gate, before.get(gate), after.get(gate))
        for gate in GATES
        if gate in before or gate in after
    ]


def moved_text(gates: list[Moved]) -> str:
    """For a terminal: a line for each gate, what differs below it."""
    lines = []
    for gate in gates:
        turned = gate.before if gate.before == gate.after else f"{gate.before} -> {gate.after}"
        lines.append(f"{gate.gate}  {NAMES[gate.gate]}: {turned}{', the same' * gate.same}")
        for one in gate.criteria:
            both = " -> ".join(text for text in (one.before, one.after) if text)
            lines.append(f"   {one.kind:<10} {one.criterion}: {both}")
        for name, keys in gate.sources.items():
            shown = ", ".join(keys[:MOST_NAMED])
            more = f" and {len(keys) - MOST_NAMED} more" if len(keys) > MOST_NAMED else ""
            lines.append(f"   {'because?':<10} {name}: {shown}{more}")
        lines += [f"   {_label(caveat):<10} {caveat}" for caveat in gate.caveats]
    return "\n".join(lines)


def _label(caveat: str) -> str:
    """What a caveat is about: an exception to a limit stands out among the others."""
    return OVERRIDDEN if is_said(caveat[2:]) else "caveat"


def _of_gate(gate: Gate, old: GateReport | None, new: GateReport | None) -> Moved:
    if old is None or new is None:
        verdicts = [NOT_JUDGED if report is None else report.verdict for report in (old, new)]
        return Moved(gate, verdicts[0], verdicts[1])
    went = [f"- {text}" for text in old.caveats if text not in new.caveats]
    came = [f"+ {text}" for text in new.caveats if text not in old.caveats]
    return Moved(
        gate=gate,
        before=old.verdict,
        after=new.verdict,
        criteria=_criteria(old, new),
        sources={name: keys for name in SOURCES if (keys := _keys(old, new, name))},
        caveats=(*went, *came),
    )


def _keys(old: GateReport, new: GateReport, name: str) -> tuple[str, ...]:
    one: Mapping[str, Any] = getattr(old, name)
    other: Mapping[str, Any] = getattr(new, name)
    keys = sorted({*one, *other})
    return tuple(k for k in keys if k not in one or k not in other or one[k] != other[k])


def _criteria(old: GateReport, new: GateReport) -> tuple[Turned, ...]:
    before, after = _by_name(old), _by_name(new)
    found = [
        turned
        for name in dict.fromkeys([*after, *before])
        for turned in _turned(name, before.get(name), after.get(name))
    ]
    return tuple(sorted(found, key=lambda turned: turned.kind != "turned"))


def _by_name(report: GateReport) -> dict[str, Answer]:
    return {f"{c.id} ({c.candidate})" if c.candidate else c.id: c for c in report.criteria}


def _turned(name: str, old: Answer | None, new: Answer | None) -> Iterator[Turned]:
    if old is None or new is None:
        kind = "added" if old is None else "gone"
        yield Turned(name, kind, *("" if c is None else _said(c) for c in (old, new)))
        return
    if old.verdict != new.verdict:
        yield Turned(name, "turned", _said(old), _said(new))
    elif (old.measured, old.interval) != (new.measured, new.interval):
        yield Turned(name, "number", _number(old), _number(new))
    if (old.threshold, old.comparison) != (new.threshold, new.comparison):
        yield Turned(name, _of_limit(old, new), limit_text(old), limit_text(new))


def _said(answer: Answer) -> str:
    return f"{answer.verdict} ({_number(answer)}, required {limit_text(answer)})"


def _number(answer: Answer) -> str:
    text = measured_text(answer)
    if answer.interval is None:
        return text
    return between(answer) if answer.measured is None else f"{text} ({between(answer)})"


def _of_limit(old: Answer, new: Answer) -> str:
    """Whether a limit moved towards letting more pass."""
    if new.threshold is None and old.threshold is not None:
        return "loosened"
    if old.comparison != new.comparison or old.threshold is None or new.threshold is None:
        return "changed"
    lower = new.threshold < old.threshold
    return "tightened" if lower == (new.comparison == "<=") else "loosened"
