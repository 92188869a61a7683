"""A criterion is one function: `@criterion` on what measures it says what is asked.

The function's name is the identifier. Its limit, with reason and owner, stands in `params.yaml`
and nowhere else; the evidence that it rests on is whatever it read. Criteria are diagnosed in the
order in which their module defines them.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from gates.report import Comparison, Recount


@dataclass(frozen=True)
class Measured:
    """What a criterion found.

    Attributes:
        value: The number; None where nothing can be said.
        interval: Its interval, if it has one.
        caveat: What the reader must know about it.
        pending: Set where only a person can supply the answer and has not yet.
        counted: The independent units that the number rests on: "24 of 25 episodes"; empty for a
            number that counts none.
        undecided: What decides where the limit lies inside the interval, without a semicolon;
            empty where more of the same evidence does.
        point: What was seen, where `value` is an end of an interval over independent units, as
            `counted` says them; says how many more would decide, and is never judged.
        recount: Which rows it counts, so that a reader counts them again.
    """

    value: float | None
    interval: tuple[float, float] | None = None
    caveat: str = ""
    pending: bool = False
    counted: str = ""
    undecided: str = ""
    point: float | None = None
    recount: Recount | None = None


@dataclass(frozen=True)
class Criterion:
    """A question of a gate and the function that measures the answer.

    Attributes:
        measure: Takes the evidence, the gate's settings and, per candidate, its name; raises
            `MissingEvidenceError` where the number cannot be had. It decides nothing.
        question: What is asked, as a reader would ask it.
        look_at: Where to look first if it is not met.
        comparison: How the number must stand to its limit.
        per_candidate: Whether each method that stands for promotion is asked.
        always: Whether it may never be declared not applicable: it guards people or the proof.
        derived: Limit that follows from the gate's settings, where `params.yaml` says `derived`.
        applies: What of the evidence shows that it does apply, in words, empty where nothing does;
            takes what `measure` takes. Asked where it is declared not applicable.
    """

    measure: Callable[..., Measured]
    question: str
    look_at: str
    comparison: Comparison
    per_candidate: bool
    always: bool
    derived: Callable[[Any], float] | None
    applies: Callable[..., str] | None = None

    @property
    def id(self) -> str:
        """Name of the criterion: that of its function."""
        return self.measure.__name__


def criterion(
    comparison: Comparison,
    *,
    question: str,
    look_at: str,
    per_candidate: bool = False,
    always: bool = False,
    derived: Callable[[Any], float] | None = None,
    applies: Callable[..., str] | None = None,
) -> Callable[[Callable[..., Measured]], Criterion]:
    """Make a criterion of the function that measures it; arguments as in `Criterion`."""

    def of(measure: Callable[..., Measured]) -> Criterion:
        return Criterion(
            measure, question, look_at, comparison, per_candidate, always, derived, applies
        )

    return of


def criteria_of(*modules: Mapping[str, Any]) -> tuple[Criterion, ...]:
    """Criteria that modules define, in the order of definition.

    Args:
        modules: Namespaces: `vars(module)`, or `globals()` of the calling module. What a module
            only imports is not its own.
    """
    return tuple(
        item
        for names in modules
        for item in names.values()
        if isinstance(item, Criterion) and item.measure.__module__ == names["__name__"]
    )
