"""The reviewer's desk: what is asked, one number a gate, what could be wrong, room to each limit.

Everything follows from the reports alone, so that the page is the same wherever they lie.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

from gates.closeness import BY_CHANCE, Closeness, by_room, closeness, first_what_does_not_hold
from gates.doubt import Doubt, sentence
from gates.more import INSIDE, hardly_decided
from gates.pages.desk_about import answers_about, asked_about, doubts_about
from gates.pages.numbers import at_its_end, beyond, judged_at
from gates.protection import REHEARSED
from gates.readable import between, human, of_units
from gates.report import GATES, NAMES, OWNERS, Answer, Gate, GateReport, report_bytes
from gates.verdicts import decided_by
from gates.words import advice_of
from genpolicy.integrity.hashing import sha256_bytes

HEADLINES: dict[Gate, tuple[str, str]] = {
    "A": ("multimodal_situations", "held-out situations in which more than one way is taken"),
    "B": ("samples_difference", "largest difference of a sample drawn again in a fresh process"),
    "C": ("admissible_share", "of the candidates pass all six layers"),
    "D": ("nominal_success_lower", "of undisturbed starts succeed"),
    "E": ("owners_signed", "owners have signed"),
}
"""The one number of each gate, and what it is a number of."""
UNREADABLE = "UNREADABLE"
NO_CARD = "no card of a rehearsal can be signed"
REAL_LADDER = (
    "Limits that protect people may be looser here; a card is of a ladder whose params.yaml does "
    "not say `rehearsal: true`."
)
JUDGE_AGAIN = "It says nothing of the one that lies here; judge again: `make ladder`."
NOTHING_BROKEN: Mapping[Gate, str] = {}


@dataclass(frozen=True)
class Asked:
    """What the reader is asked for.

    Attributes:
        title: In one sentence.
        text: Why, or what has to come first.
        pending: What waits for people; empty where nothing does.
    """

    title: str
    text: str
    pending: str


@dataclass(frozen=True)
class Box:
    """One gate in one number.

    Attributes:
        gate: Its letter.
        name: Its name.
        verdict: Of its report; `NOT JUDGED` where none lies there, `UNREADABLE` where one does
            that says nothing.
        number: As a person reads it; empty where nothing was measured.
        of: What it is a number of.
        overridden: Whether somebody overrides a limit of it, or of a gate below.
    """

    gate: Gate
    name: str
    verdict: str
    number: str
    of: str
    overridden: bool = False


@dataclass(frozen=True)
class Bar:
    """Room of one criterion; none is left where it does not hold.

    Attributes:
        near: How close it came.
        gate: Its gate.
        measured: As a person reads it.
        limit: Likewise.
        beyond: How what does not hold stands to its limit; empty where it holds.
    """

    near: Closeness
    gate: Gate
    measured: str
    limit: str
    beyond: str


@dataclass(frozen=True)
class Duty:
    """One criterion that an owner answers for.

    Attributes:
        gate: Its gate.
        answer: The criterion.
        measured: As a person reads it.
        limit: Likewise.
        remark: What the owner has to look at, or why little is to be looked at.
    """

    gate: Gate
    answer: Answer
    measured: str
    limit: str
    remark: str


@dataclass(frozen=True)
class Part:
    """What one owner answers for.

    Attributes:
        owner: The role.
        hold: How many of its criteria hold.
        duties: Its criteria: what does not hold first, then what holds, the nearest first.
    """

    owner: str
    hold: int
    duties: tuple[Duty, ...]


@dataclass(frozen=True)
class Desk:
    """The page: all of it from the reports.

    Attributes:
        asked: What the reader is asked for.
        about: Candidates that it is asked about; all bars, duties and doubts are theirs, or of a
            whole gate.
        boxes: One a gate.
        doubts: What the reader weighs one by one.
        not_shown: Caveats.
        of_others: Both about candidates that nobody asks about.
        bars: What could be near its limit.
        exact: How many more hold.
        parts: One an owner.
    """

    asked: Asked
    about: tuple[str, ...]
    boxes: tuple[Box, ...]
    doubts: tuple[Doubt, ...]
    not_shown: tuple[Doubt, ...]
    of_others: tuple[Doubt, ...]
    bars: tuple[Bar, ...]
    exact: int
    parts: tuple[Part, ...]


def desk_of(
    reports: Mapping[Gate, GateReport],
    pending: str = "",
    unreadable: Mapping[Gate, str] = NOTHING_BROKEN,
) -> Desk:
    """The desk of the reports that lie there and can be read.

    Args:
        reports: By gate.
        pending: What of the card waits for people, as `desk_card.Signing.pending` says it.
        unreadable: Why the report of a gate that lies there cannot be read, by gate.
    """
    about = asked_about(reports)
    shown = {gate: answers_about(reports[gate], about) for gate in GATES if gate in reports}
    bars = [
        Bar(near, gate, at_its_end(c), human(c, c.threshold), beyond(c))
        for gate, answers in shown.items()
        for near in by_room(answers)
        for c in (near.answer,)
    ]
    judged = [answer for answers in shown.values() for answer in answers]
    doubts, not_shown, of_others = doubts_about(reports, about)
    return Desk(
        asked=_asked(reports, pending, unreadable),
        about=about,
        boxes=tuple(_box_of(gate, reports, about, unreadable) for gate in GATES),
        doubts=doubts,
        not_shown=not_shown,
        of_others=of_others,
        bars=tuple(sorted(bars, key=lambda bar: first_what_does_not_hold(bar.near))),
        exact=sum(answer.verdict == "PASS" for answer in judged)
        - sum(bar.near.holds for bar in bars),
        parts=tuple(_part(owner, shown) for owner in OWNERS),
    )


def other_below(reports: Mapping[Gate, GateReport], gate: Gate) -> Gate | None:
    """The first gate below whose report is another one than `gate` was judged over."""
    for below in GATES[: GATES.index(gate)]:
        if below in reports and gate in reports:
            lies_here = sha256_bytes(report_bytes(reports[below]))
            if reports[gate].upstream.get(below) != lies_here:
                return below
    return None


def _asked(
    reports: Mapping[Gate, GateReport], pending: str, unreadable: Mapping[Gate, str]
) -> Asked:
    stopped = next((gate for gate in GATES if not _passes(reports.get(gate))), None)
    if nothing := _in_vain(reports, unreadable, stopped):
        return nothing
    promoted = reports["D"].promoted if "D" in reports else None
    report = reports.get(stopped) if stopped else None
    if stopped is None:
        title = f"Signed: {promoted} may move a robot, supervised, inside the card's envelope"
        return Asked(title, "The card says where, how fast, and until when.", "")
    if stopped == "E" and promoted:
        title = f"Asked of you: let {promoted} move a robot, supervised, inside one envelope?"
        return Asked(title, sentence(reports["D"].decision), pending)
    title = f"Nothing is asked of you yet: the ladder stops at gate {stopped} ({NAMES[stopped]})"
    if report is None:
        return Asked(title, "It was not judged: `make ladder`.", "")
    decided = decided_by(report)
    if decided is None:
        return Asked(title, report.diagnosis or report.decision, "")
    who = f" ({decided.candidate})" if decided.candidate else ""
    found = f"{decided.question}{who} {_against(decided)}"
    advice = advice_of(report.diagnosis) if decided.verdict == "INCONCLUSIVE" else ""
    said = (found, _next(decided, report.decision), advice)
    return Asked(title, " ".join(part for part in said if part), "")


def _in_vain(
    reports: Mapping[Gate, GateReport], unreadable: Mapping[Gate, str], stopped: Gate | None
) -> Asked | None:
    """Why nobody can be asked, where no verdict says so: what lies there is broken, or practice."""
    if stopped is not None and stopped in unreadable:
        what = f"the report of gate {stopped} ({NAMES[stopped]}) cannot be read"
        return Asked(f"Nothing is asked of you: {what}", sentence(unreadable[stopped]), "")
    for gate in GATES[: GATES.index(stopped or "E") + 1]:
        if below := other_below(reports, gate):
            what = f"gate {gate} was judged over another report of gate {below}"
            return Asked(f"Nothing is asked of you: {what}", JUDGE_AGAIN, "")
    if stopped in (None, "E") and reports["D"].promoted and rehearsed(reports):
        title = f"Nothing is asked of you: {NO_CARD}"
        return Asked(title, f"{sentence(reports['D'].decision)} {REAL_LADDER}", "")
    return None


def rehearsed(reports: Mapping[Gate, GateReport]) -> bool:
    """Whether these are reports of a rehearsal, of which no card can be signed."""
    said = (caveat for report in reports.values() for caveat in report.caveats)
    return any(caveat.startswith(REHEARSED) for caveat in said)


def _passes(report: GateReport | None) -> bool:
    return report is not None and report.verdict == "PASS"


def _against(answer: Answer) -> str:
    """Measured, against what was required."""
    sign = "at most" if answer.comparison == "<=" else "at least"
    if answer.measured is None:
        return f"Nothing was measured; required {sign} {human(answer, answer.threshold)}."
    found = human(answer, answer.measured)
    if answer.interval is not None:
        found = between(answer)
    return f"Measured {found}{of_units(answer)}; required {sign} {human(answer, answer.threshold)}."


def _next(decided: Answer, decision: str) -> str:
    """What would decide, or what follows; where to look first stands on the gate's page."""
    if decided.measured is None:
        return sentence(decided.caveat.removeprefix("not measured: ") or decision)
    if decided.verdict != "INCONCLUSIVE":
        return decision
    return sentence(decided.caveat.rpartition("; ")[2].removeprefix(f"{INSIDE}: "))


def _box_of(
    gate: Gate,
    reports: Mapping[Gate, GateReport],
    about: Collection[str],
    unreadable: Mapping[Gate, str],
) -> Box:
    report = reports.get(gate)
    if report is None:
        return Box(gate, NAMES[gate], UNREADABLE if gate in unreadable else "NOT JUDGED", "", "")
    if gate == "E" and report.verdict == "PENDING_REVIEW" and rehearsed(reports):
        box = Box(gate, NAMES[gate], report.verdict, "", NO_CARD)
    else:
        box = _box(gate, report, about)
    below = other_below(reports, gate)
    of = f"{box.of}; judged over another report of gate {below}" if below else box.of
    return replace(box, of=of, overridden=bool(report.overrides))


def headline(report: GateReport, about: Collection[str]) -> list[Answer]:
    """The criteria whose numbers are the one number of a gate: of it, or of these candidates."""
    return [c for c in answers_about(report, about) if c.id == HEADLINES[report.gate][0]]


def _box(gate: Gate, report: GateReport, about: Collection[str]) -> Box:
    of, said = HEADLINES[gate][1], headline(report, about)
    if gate == "E" and said and said[0].threshold is not None:
        signed, all_of = int(said[0].measured or 0), human(said[0], said[0].threshold)
        return Box(gate, NAMES[gate], report.verdict, f"{signed or 'none'} of {all_of}", of)
    if not said or said[0].measured is None:
        return Box(gate, NAMES[gate], report.verdict, "", f"not measured: {of}")
    texts = {c.candidate: at_its_end(c) for c in said}
    if len(texts) == 1 or len(set(texts.values())) == 1:
        return Box(gate, NAMES[gate], report.verdict, next(iter(texts.values())), of)
    each = ", ".join(f"{candidate} {text}" for candidate, text in texts.items())
    return Box(gate, NAMES[gate], report.verdict, each, of)


def _part(owner: str, shown: Mapping[Gate, list[Answer]]) -> Part:
    own = [(gate, c) for gate, answers in shown.items() for c in answers if c.owner == owner]
    own.sort(key=lambda entry: _weight(entry[1]))
    return Part(
        owner=owner,
        hold=sum(answer.verdict == "PASS" for _, answer in own),
        duties=tuple(
            Duty(gate, c, at_its_end(c), human(c, c.threshold), remark(c)) for gate, c in own
        ),
    )


def _weight(answer: Answer) -> tuple[int, float]:
    """What does not hold, what holds nearly, what holds exactly."""
    if answer.verdict != "PASS":
        return (0, 0.0)
    near = closeness(answer)
    return (2, 0.0) if near is None else (1, -near.used)


def remark(answer: Answer) -> str:
    """What the owner of a criterion has to know of it, in one sentence."""
    why = answer.caveat or "nothing was recorded that answers it"
    if answer.verdict == "INCONCLUSIVE":
        more = "" if hardly_decided(why) else ", more evidence decides"
        unsure = "not measured" if answer.interval is None else f"not decided{more}"
        return f"{unsure}: {why}"
    if answer.verdict != "PASS":
        return why
    near = closeness(answer)
    if near is None:
        return "holds exactly; there is no room to speak of"
    if near.near:
        return f"near: {near.said}" + (f"; {BY_CHANCE}" if near.chance else "")
    if answer.interval is None:
        return f"{near.said}; no interval says how sure that is"
    return near.said if near.worse_end else f"{near.said}, at {judged_at(answer)}"
