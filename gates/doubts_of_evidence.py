"""Doubts about how evidence was made: what nothing exercised, few units, one seed, an average.

Each rule reads the report alone: what a criterion counted, what it says beside its number, and the
settings. So a card repeats them from the bytes that are signed, whatever else lies here.
"""

import re
from collections.abc import Iterator

from gates.claim import MEDIAN_PASSES, SHOWN, trainings
from gates.doubt import NEVER_ASKED, OPEN_COLUMNS, Doubt, about, named
from gates.report import Answer, GateReport
from gates.reproducibility.timing import DECLARED
from gates.stress.contact import UNTOUCHED
from gates.stress.cost import TOO_OLD
from gates.stress.gains import WORST
from gates.stress.visited import BEYOND
from gates.words import percent

FEW = 20
"""Units below which a number says little: of so many, none of which fails, an exact bound of 95 %
still allows 14 % that would; and one more failure moves a share by five points."""
COUNTED = re.compile(r"(?:\d+ of )?(\d+)(?: and (\d+))? (\D+?)(?:, .*)?")
"""What a number rests on, as criteria write it: `24 of 25 episodes`, `3 and 3 processes`."""
REPEATED = "times"
"""How criteria count that ask one and the same again, to the bit: of those a few are enough."""
UNTRIED = re.compile(r"(?:not measured: )?(not exercised|hardly exercised|not asked)\b")
"""How the caveat of a criterion begins of which the evidence holds no case, or hardly one."""
LACKED = "of them not asked of this task: "
ONCE = re.compile(rf"\b{trainings(1)}\b(?!s)")
"""In caveats of what was trained with one seed."""
MEDIAN = re.compile(rf"{MEDIAN_PASSES} (?:[\d.]+ % \()?(none|[\d,]+) of ([\d,]+)\)?")
"""In the caveat that says how often the median of the neighbours passes."""
ONE_MODE = re.compile(rf"; (\S+) in ([\d.]+) % \({SHOWN}: with")
"""In the caveat that says how often a policy of one mode acts validly."""
OFTEN = 0.5
"""From this share on a rule does it as often as not, which is the limit of the judged ones."""
WAIVED_HERE = "waived_checks"
"""Setting of Gate A that names questions which its data could not be asked."""


def untried(answer: Answer) -> str:
    """Why the evidence holds no case of a criterion; empty where it does."""
    found = UNTRIED.match(answer.caveat)
    return found[1] if found and answer.verdict == "INCONCLUSIVE" else ""


def never_exercised(report: GateReport) -> Iterator[Doubt]:
    """What never happened in any rollout is neither good nor bad: nothing is known of it."""
    for answer in report.criteria:
        if untried(answer).endswith("exercised"):
            kind = "hardly exercised" if untried(answer).startswith("h") else "never exercised"
            yield about(report, kind, answer)
        unasked = answer.caveat.partition(NEVER_ASKED)[2]
        if unasked:
            text = (
                "each was refused, and for another reason than its own every time, so that the "
                f"check that it is made for had nothing to say: {named(unasked.split(', '))}"
            )
            yield about(report, "never exercised", answer, text)
    for caveat in report.caveats:
        if found := UNTOUCHED.match(caveat):
            yield Doubt(report.gate, "never exercised", caveat, (), found[1])


def open_columns(report: GateReport) -> Iterator[Doubt]:
    """Of many recorded columns only the best is held to the limit; others may tell as much."""
    for answer in report.criteria:
        columns = answer.caveat.partition(OPEN_COLUMNS)[2]
        if columns and answer.verdict == "PASS":
            text = (
                f"not decided of {named(columns.split(', '))}: of all columns only the best is "
                "held to the limit, where it beats a guess"
            )
            yield about(report, "not decided", answer, text)


def not_visited(report: GateReport) -> Iterator[Doubt]:
    """A card allows a whole box; where no rollout went in it, nothing was tried."""
    for caveat in report.caveats:
        if found := BEYOND.match(caveat):
            yield Doubt(report.gate, "not visited", caveat, (), found[1])


def not_testable(report: GateReport) -> Iterator[Doubt]:
    """Questions that could not be put to this data or this task, whoever answers for them."""
    for answer in report.criteria:
        if untried(answer) == "not asked":
            yield about(report, "not testable", answer)
        if silent := _waived(report, answer):
            text = f"{named(silent)} could not be asked of these data; an owner answers for it"
            yield about(report, "not testable", answer, text)
        lacking = answer.caveat.partition(LACKED)[2]
        if lacking:
            yield about(report, "not testable", answer, f"this task has no case of {lacking}")


def _waived(report: GateReport, answer: Answer) -> list[str]:
    """Waived questions that the data indeed left unasked."""
    if answer.id != "unasked_checks" or answer.verdict != "PASS":
        return []
    owners = report.settings.get(WAIVED_HERE) or {}
    idle = answer.caveat.partition("waived without need here: ")[2].split(", ")
    return [check for checks in owners.values() for check in checks if check not in idle]


def cold_start(report: GateReport) -> Iterator[Doubt]:
    """The first answer after a start is left out of the bound of the others."""
    for answer in report.criteria:
        if found := re.search(rf"cold at most (\S+ m?s), {TOO_OLD} of (\S+ m?s)", answer.caveat):
            text = (
                f"the first answer after a start takes up to {found[1]} and is not judged; "
                f"nothing older than {found[2]} is executed, so that the robot waits for another"
            )
            yield about(report, "cold start", answer, text)


def an_average(report: GateReport) -> Iterator[Doubt]:
    """A gain over all conditions that one of them does not share."""
    for answer in report.criteria:
        found = re.search(rf"{WORST} (\S+) (-\S+ points) over", answer.caveat)
        if found and answer.verdict == "PASS":
            of = " of utility" if report.settings.get("utility") else ""
            worst = f"{found[1]} it is {found[2]}{of}"
            text = f"it holds for the mean over all conditions; in {worst}"
            yield about(report, "an average", answer, text)


def simpler_rule(report: GateReport) -> Iterator[Doubt]:
    """A rule that nobody has to train, or one mode alone, that is shown and not judged.

    Both are valid wherever each mode is, so that a gate that judged them could not pass; whoever
    signs must know that they are.
    """
    kind = "a simpler rule passes"
    for answer in report.criteria:
        found = MEDIAN.search(answer.caveat)
        passed, of = (_count(found[1]), _count(found[2])) if found else (0, 0)
        if found and of and passed >= OFTEN * of:
            text = f"the point-wise {found[0]} ({SHOWN}): it needs no training"
            yield about(report, kind, answer, text)
        found = ONE_MODE.search(answer.caveat)
        share = float(found[2]) / 100.0 if found else 0.0
        if found and share >= OFTEN:
            said = f"{found[1]} acts validly in {percent(share)} of the situations ({SHOWN})"
            yield about(
                report, kind, answer, f"with one mode alone {said}; Gate D asks it in motion"
            )


def _count(said: str) -> int:
    """A count as sentences write it: `1,080`, `none`."""
    return 0 if said == "none" else int(said.replace(",", ""))


def few_units(report: GateReport) -> Iterator[Doubt]:
    """A number of few units is one of which little can be said, whatever it is."""
    fewest: dict[str, tuple[int, str]] = {}
    for answer in report.criteria:
        found = COUNTED.fullmatch(answer.counted)
        if found and found[3] != REPEATED and answer.verdict in ("PASS", "FAIL"):
            own = min(int(number) for number in found.groups()[:2] if number), answer.counted
            fewest[answer.id] = min(fewest.get(answer.id, own), own)
    few = sorted((units, name, said) for name, (units, said) in fewest.items() if units < FEW)
    if few:
        listed = named([f"{name} ({said})" for _, name, said in few])
        criteria = "1 criterion rests" if len(few) == 1 else f"{len(few)} criteria rest"
        text = f"{criteria} on fewer than {FEW} units: {listed}"
        yield Doubt(report.gate, "small n", text, tuple(name for _, name, _ in few))


def one_seed(report: GateReport) -> Iterator[Doubt]:
    """A training drawn once: what another draw gives, nobody has seen."""
    once = [c for c in report.criteria if ONCE.search(c.caveat)]
    if once:
        who = list(dict.fromkeys(c.candidate for c in once if c.candidate))
        said = named(who) or "the simpler policies that this gate judges"
        text = f"{said}: trained once; what another training seed gives was not seen"
        yield Doubt(report.gate, "one training seed", text, (once[0].id,))


def declared(report: GateReport) -> Iterator[Doubt]:
    """Latency that somebody wrote down is not what the cell takes."""
    said: dict[str, Answer] = {}
    for answer in report.criteria:
        found = re.search(rf"(\d+ of \d+) terms {DECLARED}: ([^;]+)", answer.caveat)
        if found and not found[1].startswith("0 "):
            said.setdefault(f"{found[1]} latency terms are {DECLARED}: {found[2]}", answer)
    for text, answer in said.items():
        yield Doubt(report.gate, "declared", text, (answer.id,), "")
