"""What `genpolicy diagnose` prints: walks, answers and checkpoint rows, for a terminal."""

import textwrap
from collections.abc import Iterable, Sequence

from gates.diagnosis.checkpoints import Ruled
from gates.diagnosis.looking import Number
from gates.diagnosis.reports import Reports
from gates.diagnosis.symptoms import Answered, Asked, Symptom
from gates.diagnosis.walk import Walk
from gates.report import GATES

WIDE = 80


def gates_text(reports: Reports) -> str:
    """Which reports the answers stand on, and why the others cannot be used."""
    judged = ", ".join(
        f"{gate} {reports.judged[gate].verdict}" for gate in GATES if gate in reports.judged
    )
    lines = [f"Proved now: {judged or 'no report'}."]
    lines += [_said(f"{why}.") for why in dict.fromkeys(reports.missing.values())]
    return "\n".join(lines)


def walk_text(walk: Walk) -> str:
    """One walk, a line for each place."""
    lines = [f"{walk.candidate or 'every candidate'}, in the chapter's order"]
    for number, stop in enumerate(walk.stops, start=1):
        lines.append(
            f"  {number}  {stop.place:<20}{stop.state:<17}{stop.asked:>2} criteria answered"
        )
        lines += [_said(text, indent=5) for text in stop.unmet]
        lines += [_said(f"not asked: {text}", indent=5) for text in stop.not_asked]
    ended = walk.ended_at
    if ended is not None:
        first = f"First that is not in order: {ended.place}. Look there."
        lines.append(_said(f"{first} What lies behind it was not asked: {_behind(walk.behind)}."))
    else:
        lines.append(_said(_nothing_red(walk)))
    return "\n".join(lines)


def _nothing_red(walk: Walk) -> str:
    waits = dict.fromkeys(why for stop in walk.stops for why in stop.waits_for)
    if waits:
        return f"Nothing is red as far as was asked; the rest waits: {_list(waits)}."
    if not walk.whole or any(stop.not_asked for stop in walk.stops):
        return "Nothing is red as far as was asked; what was not asked stands at its place."
    return "Nothing is red: every place was asked, and holds."


def answered_text(answered: Answered) -> str:
    """One symptom, as it was answered."""
    lines = [f"{answered.row} · {answered.candidate or 'every candidate'}"]
    if answered.before_all:
        said = "What is found behind it may be its consequence."
        lines.append(_said(f"Before all: {answered.before_all}. {said}"))
    lines += [*_asked_lines("Inspected first", answered.first)]
    lines += [*_asked_lines("Inspected next", answered.then)]
    lines.append(_said(f"Look {answered.look_next}."))
    lines.append(_said(f"Do not conclude: {answered.do_not_conclude}."))
    return "\n".join(lines)


def symptoms_text(symptoms: Sequence[Symptom]) -> str:
    """The names that can be asked for."""
    wide = max(len(symptom.name) for symptom in symptoms)
    lines = ["What do you see? `genpolicy diagnose --symptom NAME`, NAME one of"]
    lines += [f"  {symptom.name:<{wide}}  {symptom.row}" for symptom in symptoms]
    return "\n".join(lines)


def checkpoints_text(rows: Sequence[Ruled]) -> str:
    """The nine rows, a line for each, and what does not hold below it."""
    lines = [f"{'area':<13}{'owner':<12}{'verdict':<15}promotion is rejected when"]
    for row in rows:
        lines.append(f"{row.area:<13}{row.owner:<12}{row.verdict:<15}{row.reject_when}")
        carried = f"{len(row.criteria)} criteria"
        if len(row.limits_of) > 1:
            carried += f", limits by {', '.join(row.limits_of)}"
        lines.append(_said(f"{carried}: {', '.join(row.criteria)}", indent=13))
        lines += [_said(f"not met: {text}", indent=13) for text in row.unmet]
        lines += [_said(f"waits: {text}", indent=13) for text in row.waits_for]
        lines += [_said(f"not asked: {text}", indent=13) for text in row.not_asked]
    return "\n".join(lines)


def _asked_lines(title: str, asked: Asked) -> Iterable[str]:
    yield _said(f"{title}: {asked.at}. {asked.query}", indent=0)
    for number in asked.numbers:
        yield _said(_number(number), indent=2, then=4)
    for cause in asked.causes:
        yield _said(f"SPEAKS: {cause}", indent=2, then=4)
    for text in asked.undecided:
        yield _said(f"Not decided: {text}.", indent=2, then=4)
    for text in (*asked.unknown, *asked.waits_for):  # some are sentences, which have an end
        yield _said(f"Not known: {text.removesuffix('.')}.", indent=2, then=4)
    if not asked.numbers:
        yield _said("Nothing could be asked.", indent=2)
    elif not asked.causes:
        yield _said("Nothing speaks in what could be asked.", indent=2)


def _number(number: Number) -> str:
    limit = f", required {number.limit}: {number.verdict}" if number.limit else ""
    counted = f" [{number.counted}]" if number.counted else ""
    mark = "" if number.what.endswith("?") else ":"
    return f"{number.what}{mark} {number.value}{limit}{counted} ({number.where})"


def _behind(places: Sequence[str]) -> str:
    return ", ".join(places) or "nothing, it is the last"


def _list(texts: Iterable[str]) -> str:
    return "; ".join(texts)


def _said(text: str, *, indent: int = 0, then: int | None = None) -> str:
    """A sentence, folded to the width of a terminal; names and paths stay whole."""
    return textwrap.fill(
        text[:1].upper() + text[1:] if indent == 0 else text,
        WIDE,
        initial_indent=" " * indent,
        subsequent_indent=" " * (indent if then is None else then),
        break_long_words=False,
        break_on_hyphens=False,
    )
