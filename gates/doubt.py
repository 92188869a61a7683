"""One reason why a verdict may be wrong, and the words that all rules share."""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace

from gates.report import Answer, GateReport

MOST_NAMED = 3
"""Criteria that one doubt names; of more it says how many there are."""
OPEN_COLUMNS = "not decided, and not held to the limit: "
"""In the caveat that names recorded columns whose intervals lie astride the limit."""
NEVER_ASKED = "never for its own: "
"""In the caveat that names corruptions whose own check refused none of a candidate's chunks."""
GAP = "\0"
"""In place of a name; no sentence holds one."""


@dataclass(frozen=True)
class Doubt:
    """One reason why the verdict may be wrong.

    Attributes:
        gate: Whose evidence it is about.
        kind: In two or three words.
        text: What is the matter, for a person.
        criteria: Criteria that it is about, by name; empty for a caveat of the whole gate.
        candidate: Whose criterion it is; empty where it is one of the whole gate, or several.
        also: Other gates of whose evidence the very same is said.
    """

    gate: str
    kind: str
    text: str
    criteria: tuple[str, ...] = ()
    candidate: str = ""
    also: tuple[str, ...] = ()


def about(report: GateReport, kind: str, answer: Answer, more: str = "") -> Doubt:
    """A doubt about one criterion.

    Args:
        report: Of its gate.
        kind: In two or three words.
        answer: The criterion.
        more: What is the matter; its own caveat if empty.
    """
    who = f" ({answer.candidate})" if answer.candidate else ""
    why = more or answer.caveat or "nothing was recorded that answers it"
    return Doubt(report.gate, kind, f"{answer.question}{who} {sentence(why)}", (answer.id,),
                 answer.candidate or "")  # fmt: skip


def named(items: Sequence[str]) -> str:
    """The first few of a list, and how many more there are."""
    more = len(items) - MOST_NAMED
    return ", ".join(items[:MOST_NAMED]) + (f" and {more} more" if more > 0 else "")


def sentence(text: str) -> str:
    """Words as a sentence: its first letter large, and an end.

    A name at its head stays as it is: one with an underscore, or one before a colon.
    """
    first = text.partition(" ")[0]
    head = text[:1] if "_" in first or first.endswith(":") else text[:1].upper()
    return head + text[1:] + ("" if text.endswith(".") else ".")


def said_once(doubts: Iterable[Doubt], names: Collection[str]) -> list[Doubt]:
    """Doubts that differ by the name of a candidate alone as one with all names, at the first.

    The very same words about several gates are one as well, with all gates.

    Args:
        doubts: In the order in which they are said.
        names: Of candidates.
    """
    found: dict[tuple[str, str, str], list[tuple[str, Doubt]]] = {}
    for doubt in doubts:
        name, rest = _apart(doubt.text, names)
        found.setdefault((doubt.gate if name else "", doubt.kind, rest), []).append((name, doubt))
    same: dict[tuple[str, str], Doubt] = {}
    for told in (_together(own, rest) for (_, _, rest), own in found.items()):
        first = same.setdefault((told.kind, told.text), told)
        if told.gate != first.gate:
            gates = tuple(dict.fromkeys((*first.also, told.gate, *told.also)))
            same[told.kind, told.text] = replace(first, also=gates)
    return list(same.values())


def texts_once(texts: Iterable[str], names: Collection[str]) -> list[str]:
    """The same of sentences without a kind: caveats of one gate."""
    return [one.text for one in said_once((Doubt("", "", text) for text in texts), names)]


def about_one_of(text: str, names: Collection[str]) -> bool:
    """Whether a sentence is about one of these candidates, by its head or its question."""
    return bool(_apart(text, names)[0])


def _apart(text: str, names: Collection[str]) -> tuple[str, str]:
    """The candidate that a sentence is about, and the sentence with a gap in its place.

    It stands at the head before a colon, or in brackets behind the question.
    """
    for name in names:
        if text.startswith(f"{name}: "):
            return name, GAP + text.removeprefix(name)
        head, found, tail = text.partition(f"? ({name}) ")
        if found:
            return name, f"{head}? ({GAP}) {tail}"
    return "", text


def _together(own: Sequence[tuple[str, Doubt]], rest: str) -> Doubt:
    first = own[0][1]
    names = list(dict.fromkeys(name for name, _ in own if name))
    gates = tuple(dict.fromkeys(doubt.gate for _, doubt in own))
    if len(names) < 2:
        return replace(first, also=gates[1:])
    # What is counted is counted of each: six failures of both are not three of either.
    all_names = f"{', '.join(names[:-1])} and {names[-1]}, each"
    return replace(first, text=rest.replace(GAP, all_names, 1), candidate="")
