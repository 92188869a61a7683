"""What a cause is made of: its name, and every question with its number and its limit."""

from dataclasses import dataclass
from enum import StrEnum
from typing import Any, Literal

NEXT = "Train the simple baselines on this dataset and see whether they lose the modes."


class CauseName(StrEnum):
    """Why demonstrations differ where the observation does not."""

    VALID_MODES = "valid_modes"
    HIDDEN_STATE = "hidden_state"
    DATA_DEFECT = "data_defect"
    LABEL_CONTAMINATION = "label_contamination"
    POINTWISE_NOISE = "pointwise_noise"
    UNIMODAL = "unimodal"
    INSUFFICIENT_SUPPORT = "insufficient_support"


class Topic(StrEnum):
    """The topics of the diagnosis, in the order in which they are believed."""

    DATA = "data"
    LABELS = "labels"
    SUPPORT = "support"
    STRUCTURE = "structure"
    HIDDEN = "hidden"
    VALIDITY = "validity"
    AGREEMENT = "agreement"
    NONE = "none"


@dataclass(frozen=True)
class Answer:
    """One number held against its limit.

    Attributes:
        question: Name of the limit.
        topic: Topic of the diagnosis.
        what: What was measured, in words.
        measured: The number; None where it is not known.
        limit: Its limit; None where nothing is held against it.
        comparison: How the two must stand to each other.
        unit: Unit of both; empty for counts and shares.
        note: Where, or why it is not known.
        interval: Interval of the number, where it has one.
        counted: The units that the number rests on; empty where it counts none.
        mode: The one mode that it counts; empty where it is about several, or none.
    """

    question: str
    topic: Topic
    what: str
    measured: float | None
    limit: float | None
    comparison: Literal["<=", ">="] = "<="
    unit: str = ""
    note: str = ""
    interval: tuple[float, float] | None = None
    counted: str = ""
    mode: str = ""

    @property
    def holds(self) -> bool | None:
        """Whether the number keeps its limit, NaN never; None where nothing is known or asked."""
        if self.measured is None or self.limit is None:
            return None
        margin = self.limit - self.measured
        return bool(margin >= 0 if self.comparison == "<=" else -margin >= 0)

    @property
    def red(self) -> bool:
        """Known, and beyond its limit."""
        return self.holds is False

    def as_json(self) -> dict[str, Any]:
        """A row of `audit.json`."""
        return {
            "question": self.question, "layer": self.topic.value, "what": self.what,
            "measured": None if self.measured is None else float(self.measured),
            "limit": self.limit,
            "comparison": self.comparison, "unit": self.unit,
            "note": self.note, "holds": self.holds,
        }  # fmt: skip


@dataclass(frozen=True)
class Diagnosis:
    """What a red topic says: a cause, the variable and kind that it names, and what to do."""

    name: CauseName
    variable: str
    kind: str
    next_action: str


Named = tuple[list[Answer], Diagnosis | None]
"""The answers of a topic, and what it says where it is red."""


@dataclass(frozen=True)
class Cause:
    """The cause of different actions under one observation.

    Attributes:
        name: The cause.
        variable: The variable or stream that it names; empty where it names none.
        kind: The kind of defect or of evidence; empty where there is none.
        topic: First red topic of the diagnosis, `none` where all are green.
        next_action: What to do.
        answers: Every question with its number and limit, in the order of diagnosis.
        confidence: Share of resampled audits with the same cause and variable, of one more than
            there were, less what no resample shows (`gates.cause.confidence`); None without any.
            Where more of them contradict the cause it is not said, and this is about those.
        agreeing: How many of how many resampled audits name the same; where it is not said, how
            many contradict it.
        found: What was found of modes and hidden variables, a sentence each, whatever the verdict.
        beside: Where modes were looked for, and those that the cause does not speak of, a sentence
            each.
    """

    name: CauseName
    variable: str
    kind: str
    topic: Topic
    next_action: str
    answers: tuple[Answer, ...]
    confidence: float | None
    agreeing: tuple[int, int] = (0, 0)
    found: tuple[str, ...] = ()
    beside: tuple[str, ...] = ()

    @property
    def text(self) -> str:
        """The cause with the variable, else the kind, that it names."""
        return in_words(self.name, self.variable or self.kind)


def in_words(name: CauseName, *details: str) -> str:
    """A cause with what it names, each once."""
    named = ", ".join(dict.fromkeys(part for part in details if part))
    return f"{name}({named})" if named else str(name)
