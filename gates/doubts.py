"""What could make a verdict wrong, derived from the criteria by rules, before the good news.

A reader sees that twenty-two of twenty-four hold. What would change the decision is elsewhere: what
was never measured, what nearly broke, what was judged at a point, what nobody asked. What speaks of
how the evidence was made (few units, one seed, an average) is in `gates.doubts_of_evidence`.
"""

import re
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import replace

from gates.closeness import BY_CHANCE, by_room, closeness
from gates.doubt import MOST_NAMED, Doubt, about, about_one_of, named, said_once
from gates.doubts_of_evidence import (
    an_average,
    cold_start,
    declared,
    few_units,
    never_exercised,
    not_testable,
    not_visited,
    one_seed,
    open_columns,
    simpler_rule,
    untried,
)
from gates.overrides import is_said
from gates.preregistration import PREREGISTRATION
from gates.protection import REHEARSED
from gates.report import GateReport
from gates.settings import WAIVED
from gates.stress.clocks import DIFFER, UNSEEN
from gates.stress.contact import UNTOUCHED
from gates.stress.visited import BEYOND
from gates.verdicts import stopping

OF_ALL = {
    REHEARSED: "a rehearsal",
    f"Loosened since {PREREGISTRATION}": "limits loosened",
    f"Changed since {PREREGISTRATION}": "plan changed",
}
"""How caveats begin that each gate repeats of those below it, and their kind on the first page."""
CLOCKS = (f"the wall clock {DIFFER} (", f"the wall clock was {UNSEEN} (")
"""In caveats of Gate D that contradict its timing, or leave it without a witness."""
LISTING = re.compile(r"(.*?(?:Looser|\.yaml)): (.*)\.", re.DOTALL)
"""A caveat that lists settings: what it is about, and the list."""
BETWEEN = re.compile(r"(?<=\)), (?=\S+ \()")
"""Between two settings that say from what to what they moved."""


def doubts_of(report: GateReport) -> list[Doubt]:
    """Every doubt about one gate's verdict, the gravest kind first, caveats last."""
    return [doubt for rule in RULES for doubt in rule(report)]


def of_a_ladder(reports: Iterable[GateReport]) -> tuple[list[Doubt], list[Doubt]]:
    """Doubts about all gates: what a reader weighs one by one, and what no gate shows.

    The gravest kind first, whatever its gate. What several gates say is said once: a rehearsal and
    moved limits by the gate that names most of them, which hold for those below it too. So is
    what holds of several candidates alike.

    Returns:
        The first are few, and begin with what is overridden, rehearsal, moved limits, what was
        waived and clocks that differ; the second are caveats.
    """
    every = list(reports)
    weighed = [doubt for rule in RULES[:-1] for report in every for doubt in rule(report)]
    caveats: dict[str, Doubt] = {}
    for doubt in (doubt for report in every for doubt in _caveats(report)):
        key = next((head for head in OF_ALL if doubt.text.startswith(head)), doubt.text)
        if key not in caveats or len(doubt.text) > len(caveats[key].text):
            caveats[key] = doubt
    first = [
        replace(caveats[head], kind=kind, text=_the_worst(caveats[head].text))
        for head, kind in OF_ALL.items()
        if head in caveats
    ]
    others = [doubt for key, doubt in caveats.items() if key not in OF_ALL]
    clocks = [
        replace(doubt, kind="two clocks")
        for doubt in others
        if any(sign in doubt.text for sign in CLOCKS)
    ]
    waived = [replace(doubt, kind="not asked") for doubt in others if WAIVED.match(doubt.text)]
    overridden = [replace(doubt, kind="overridden") for doubt in others if is_said(doubt.text)]
    said = {doubt.text for doubt in (*waived, *clocks, *overridden)}
    names = list(dict.fromkeys(name for report in every for name in report.candidates))
    weighed = overridden + first + waived + clocks + weighed
    rest = (one for one in others if one.text not in said)
    return said_once(weighed, names), said_once(rest, names)


def for_a_card(report: GateReport, candidate: str) -> list[str]:
    """What a person signs in spite of: doubts about one candidate and the gate, as sentences.

    What is said of another candidate is left out, but for what stopped it.

    Args:
        report: Of one gate.
        candidate: The promoted one.
    """
    found = doubts_of(about_these(report, [candidate]).model_copy(update={"caveats": ()}))
    return [f"Gate {doubt.gate}, {doubt.kind}: {doubt.text}" for doubt in found]


def about_these(report: GateReport, names: Collection[str]) -> GateReport:
    """What a report says of the whole gate and of these candidates, and what stopped others."""
    kept = (c for c in report.criteria if c.candidate in (None, *names) or c.verdict == "FAIL")
    others = report.candidates.keys() - set(names)
    caveats = (text for text in report.caveats if not about_one_of(text, others))
    return report.model_copy(update={"criteria": tuple(kept), "caveats": tuple(caveats)})


def about_others(report: GateReport, names: Collection[str]) -> GateReport:
    """The rest of a report: what is said of other candidates than these, and did not stop them."""
    kept = (c for c in report.criteria if c.candidate not in (None, *names) and c.verdict != "FAIL")
    others = report.candidates.keys() - set(names)
    caveats = (text for text in report.caveats if about_one_of(text, others))
    return report.model_copy(update={"criteria": tuple(kept), "caveats": tuple(caveats)})


def _not_measured(report: GateReport) -> Iterator[Doubt]:
    """A criterion without a number says nothing, whatever the others say."""
    for answer in report.criteria:
        if answer.verdict == "INCONCLUSIVE" and answer.interval is None and not untried(answer):
            yield about(report, "not measured", answer)


def _not_decided(report: GateReport) -> Iterator[Doubt]:
    """The limit lies inside the interval: other episodes of the same truth would say otherwise."""
    for answer in report.criteria:
        if answer.verdict == "INCONCLUSIVE" and answer.interval is not None:
            yield about(report, "not decided", answer)


def _stopped(report: GateReport) -> Iterator[Doubt]:
    """A candidate that fails beside one that passes: whoever chooses knows what fell away."""
    for name, broken in sorted(stopping(report).items()):
        if broken and report.candidates[name] == "FAIL" and report.verdict == "PASS":
            ids = tuple(c.id for c in broken)
            yield Doubt(report.gate, "stopped here", f"{name}: {', '.join(ids)}", ids)


def _near(report: GateReport) -> Iterator[Doubt]:
    """What holds with next to no room, by the rule of `gates.closeness`."""
    held = [near for near in by_room(list(report.criteria)) if near.near]
    for near in held:
        end = "at the worse end of its interval" if near.worse_end else "at a point"
        said = f"{near.said}, {end}" + (f"; {BY_CHANCE}" if near.chance else "")
        yield about(report, "near its limit", near.answer, said)


def _at_a_point(report: GateReport) -> Iterator[Doubt]:
    """A number without an interval holds for the very episodes that were drawn."""
    points = [
        c
        for c in report.criteria
        if c.verdict == "PASS" and c.interval is None and closeness(c) is not None
    ]
    ids = tuple(dict.fromkeys(c.id for c in points))
    if ids:
        text = f"{len(ids)} criteria hold for what was drawn, without an interval: {named(ids)}"
        yield Doubt(report.gate, "judged at a point", text, ids)


def _caveats(report: GateReport) -> Iterator[Doubt]:
    """What the gate itself says that it does not show, and what was waived."""
    for caveat in report.caveats:
        if not (UNTOUCHED.match(caveat) or BEYOND.match(caveat)):  # a rule speaks of it
            yield Doubt(report.gate, "not shown", caveat)


def _the_worst(caveat: str) -> str:
    """A caveat that lists settings, with the first of them, and how many more there are.

    What moved since the plan begins with what moved furthest.
    """
    found = LISTING.fullmatch(caveat)
    if found is None:
        return caveat
    items = BETWEEN.split(found[2]) if found[2].endswith(")") else found[2].split(", ")
    if len(items) <= MOST_NAMED:
        return caveat
    return f"{found[1]}: {named(items)}. The caveats of the gate name all."


RULES: Sequence[Callable[[GateReport], Iterator[Doubt]]] = (
    _not_measured,
    _not_decided,
    open_columns,
    never_exercised,
    not_visited,
    not_testable,
    _stopped,
    cold_start,
    an_average,
    simpler_rule,
    few_units,
    one_seed,
    declared,
    _near,
    _at_a_point,
    _caveats,
)
"""In the order of their weight for a reader."""
