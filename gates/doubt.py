"""One reason why a verdict may be wrong, and the words that all rules share."""

from collections.abc import Sequence
from dataclasses import dataclass

from gates.report import Answer, GateReport

MOST_NAMED = 3
"""Criteria that one doubt names; of more it says how many there are."""


@dataclass(frozen=True)
class Doubt:
    """One reason why the verdict may be wrong.

    Attributes:
        gate: Whose evidence it is about.
        kind: In two or three words.
        text: What is the matter, for a person.
        criteria: Criteria that it is about, by name; empty for a caveat of the whole gate.
        candidate: Whose criterion it is; empty where it is one of the whole gate, or several.
    """

    gate: str
    kind: str
    text: str
    criteria: tuple[str, ...] = ()
    candidate: str = ""


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
