"""The walk: place after place in the chapter's order, as far as the first that is not in order."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

from gates.criterion import Criterion
from gates.diagnosis.places import PLACES, place_of
from gates.diagnosis.reports import OF_EVIDENCE, Reports
from gates.overrides import OVERRIDDEN
from gates.proof import SPECS
from gates.readable import human, limit_text, measured_text
from gates.report import Answer, Gate, GateReport
from gates.verdicts import overridden_here

State = Literal["in order", "in order so far", "not asked", "not decided", "RED"]
STOPS: tuple[State, ...] = ("RED", "not decided")


@dataclass(frozen=True)
class Stop:
    """One place of the order, as it was found.

    Attributes:
        place: Its name.
        state: `RED` where a criterion is broken, `not decided` where one is open; `in order so far`
            where the rest waits for a gate that is not judged, or was not asked of a candidate that
            is unmatched by exception; `not asked` where nothing was answered.
        asked: Criteria that were answered.
        unmet: Those that do not hold, as sentences: what was measured, the limit, who overrides
            it, where to look.
        waits_for: Why some criteria have no answer yet.
        not_asked: What was waived or excepted, by whose word and why.
    """

    place: str
    state: State
    asked: int
    unmet: tuple[str, ...] = ()
    waits_for: tuple[str, ...] = ()
    not_asked: tuple[str, ...] = ()


@dataclass(frozen=True)
class Walk:
    """The order as it was gone for one candidate.

    Attributes:
        candidate: Whose; empty where no gate has judged one.
        stops: Places that were looked at.
        behind: Places that were not, because an earlier one is not in order.
    """

    candidate: str
    stops: tuple[Stop, ...]
    behind: tuple[str, ...] = field(default=())

    @property
    def ended_at(self) -> Stop | None:
        """The first place that is not in order; None where none is."""
        last = self.stops[-1]
        return last if last.state in STOPS else None

    @property
    def whole(self) -> bool:
        """Whether every place was asked all that it can be asked, what was waived left out."""
        return all(stop.state == "in order" for stop in self.stops)


def walk(reports: Reports, candidate: str) -> Walk:
    """Go through the order for one candidate, and stop where something is not in order."""
    stops: list[Stop] = []
    for number, place in enumerate(PLACES, start=1):
        stops.append(_look(reports, candidate, place))
        if stops[-1].state in STOPS:
            return Walk(candidate, tuple(stops), PLACES[number:])
    return Walk(candidate, tuple(stops))


def criteria_at(place: str) -> list[tuple[Gate, Criterion]]:
    """Criteria of a place, gate after gate, each gate's in its own order."""
    return [
        (gate, item)
        for gate in OF_EVIDENCE
        for item in SPECS[gate].criteria
        if place_of(item) == place
    ]


def _look(reports: Reports, candidate: str, place: str) -> Stop:
    answers: list[tuple[Gate, Criterion, Answer]] = []
    waits: dict[str, None] = {}
    for gate, item in criteria_at(place):
        found = reports.answer(f"{gate}.{item.id}", candidate)
        if isinstance(found, Answer):
            answers.append((gate, item, found))
        elif found.waits:
            waits[found.why] = None
    red = [one for one in answers if one[2].verdict == "FAIL"]
    unmet = red or [one for one in answers if one[2].verdict != "PASS"]
    names = [f"{gate}.{item.id}" for gate, item in criteria_at(place)]
    left_out = tuple(text for name in names for text in reports.not_asked(name, candidate))
    partly = bool(waits) or any(reports.is_excepted(name, candidate) for name in names)
    state = _state(bool(red), bool(unmet), len(answers), partly)
    return Stop(place, state, len(answers), _sentences(reports, unmet), tuple(waits), left_out)


def _state(red: bool, unmet: bool, asked: int, partly: bool) -> State:
    if red:
        return "RED"
    if unmet:
        return "not decided"
    if partly or not asked:
        return "in order so far" if asked else "not asked"
    return "in order"


def _sentences(
    reports: Reports, unmet: Sequence[tuple[Gate, Criterion, Answer]]
) -> tuple[str, ...]:
    return tuple(
        f"{answer.id} (gate {gate}): {measured_text(answer)}, required {limit_text(answer)}. "
        f"{_overridden(answer, reports.judged[gate])}{item.look_at}"
        for gate, item, answer in unmet
    )


def _overridden(answer: Answer, report: GateReport) -> str:
    """Who let it be looser at its gate: it stays broken, and is where to look."""
    entry = overridden_here(answer, report)
    if entry is None:
        return ""
    held = f"{entry.comparison} {human(answer, entry.limit)}"
    return f"{OVERRIDDEN} by {entry.by} until {entry.expires}: {entry.instead} by {held}. "
