"""What a catalogue entry is: the planted cause, its strengths, and what counts as the right answer.

Order of diagnosis: data, labels, support, structure, hidden state, validity. Of two planted
causes, the first red layer is the answer.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

from benchmarks.audit.plan import Defect, Plan

PERIOD_S = {"planar": 0.1, "insertion": 0.05}
HALF = (0.5, 0.5)


@dataclass(frozen=True)
class Answer:
    """A verdict that counts as right.

    Attributes:
        cause: The verdict.
        names: One of these must occur in its variable or kind; none: any will do.
        never: This must not be its kind.
    """

    cause: str
    names: tuple[str, ...] = ()
    never: str = ""

    def fits(self, cause: str, variable: str, kind: str) -> bool:
        """Whether a verdict is this one."""
        text = f"{variable} {kind}"
        named = not self.names or any(name in text for name in self.names)
        return cause == self.cause and named and (not self.never or kind != self.never)


VALID = Answer("valid_modes")
UNIMODAL = Answer("unimodal", never="one_valid_mode")
SUPPORT = Answer("insufficient_support")
NOISE = Answer("pointwise_noise")
LABELS = Answer("label_contamination")
ONE_VALID = Answer("unimodal", ("one_valid_mode",))
CLOCK = Answer("data_defect", ("clock", "drift"))
CALIBRATION = Answer("data_defect", ("calibration",))
UNIT = Answer("data_defect", ("unit",))
FRAME = Answer("data_defect", ("frame", "rotat", "mirror", "swap"))
REPEATED = Answer("data_defect", ("duplicate",))
GAPS = Answer("data_defect", ("gap", "rate", "jitter"))
FROZEN = Answer("data_defect", ("frozen",))
GLUED = Answer("data_defect", ("glue", "duplicate"))
EPOCH = (Answer("data_defect", ("epoch",)), Answer("hidden_state", ("epoch",)))
ORDER = Answer("hidden_state", ("order", "session", "previous", "unrecorded"))


def hidden(name: str) -> Answer:
    """A hidden variable by name."""
    return Answer("hidden_state", (name,))


@dataclass(frozen=True)
class Cause:
    """One kind of planted cause.

    Attributes:
        name: Its name in the tables.
        group: Name of its row in the confusion matrix.
        unit: What the strength is measured in.
        strengths: From invisible to obvious.
        minimum: Strength from which it is to be named; up to it if `falling`. It is the detector's
            own limit: there and just above it errors are to be expected, and they are counted.
        reason: Which limit that is.
        plan: Plan of one data set from its seed, strength and task.
        answers: Right answers from the minimum on.
        weaker: Further right answers below the minimum.
        falling: Smaller strengths are stronger.
    """

    name: str
    group: str
    unit: str
    strengths: tuple[float, ...]
    minimum: float
    reason: str
    plan: Callable[[int, float, str], Plan]
    answers: tuple[Answer, ...]
    weaker: tuple[Answer, ...] = ()
    falling: bool = False

    def strong(self, strength: float) -> bool:
        """Whether a strength is one at which the cause is to be named."""
        return strength <= self.minimum if self.falling else strength >= self.minimum


def base(seed: int) -> Plan:
    """Data sets in which a fault of data or labels is planted: with one mode, or with two."""
    return Plan(seed, shares=HALF if seed % 2 else (1.0,))


def fault(
    name: str, group: str, unit: str, strengths, minimum: float, reason: str,
    defect: Callable[[float], Defect], answer: Answer,
) -> Cause:  # fmt: skip
    """A fault of the recording in a data set with one mode or with two."""
    return Cause(
        name, group, unit, strengths, minimum, reason,
        lambda seed, s, task: replace(base(seed), defects=(defect(s),)),
        (answer,), (VALID, UNIMODAL, SUPPORT),
    )  # fmt: skip
