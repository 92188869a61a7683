"""What a policy in a process of its own can do wrong while it is asked: each has a name."""

from enum import StrEnum

from genpolicy.errors import GenpolicyError


class Fault(StrEnum):
    """Kinds of faults, as a journal writes them; each ends the invocation."""

    LATE = "late"
    """No answer in time."""
    CLOSED = "closed"
    """It hung up, died, or was not there."""
    REFUSED = "refused"
    """It answered with an error of its own."""
    OVERSIZE = "oversize"
    """A message beyond the limit."""
    MALFORMED = "malformed"
    """Bytes that are no message."""
    SHAPE = "shape"
    """No actions, or not as many as were declared."""
    UNREQUESTED = "unrequested"
    """An answer to something that was not asked."""
    CHANGED = "changed"
    """It says that it is another one than it was."""
    NONFINITE = "nonfinite"
    """It answered, and no chunk of the answer is finite numbers throughout."""
    GONE = "gone"
    """It failed so often in a row that it is asked no more."""


WHOLE = "one answer to one message, of the declared shape"
LOOK = "Look at what the server prints; `genpolicy check-candidate` asks it alone."
EXPECTED = {
    Fault.LATE: "an answer in time",
    Fault.CLOSED: "a server that listens and stays",
    Fault.REFUSED: WHOLE,
    Fault.OVERSIZE: "messages of at most 16 MiB",
    Fault.MALFORMED: "a map in msgpack, as openpi writes it",
    Fault.SHAPE: WHOLE,
    Fault.UNREQUESTED: WHOLE,
    Fault.CHANGED: "one checkpoint and one sampler from its start to its end",
    Fault.NONFINITE: "finite numbers",
    Fault.GONE: "an answer now and then",
}
ACTION = {
    Fault.LATE: "Allow it more (`timeout_s`, `start_timeout_s`), or make it faster.",
    Fault.CLOSED: "Start the server that `address` names, or run `command` by hand and read what "
    "it prints.",
    Fault.SHAPE: "Correct `action` and `horizons` of the entry, or the server.",
    Fault.CHANGED: "Start it anew, and serve one checkpoint.",
}


class PolicyError(GenpolicyError):
    """A policy's process failed an invocation; there is no chunk, and nothing of ours is broken.

    Args:
        fault: Which kind.
        found: What was seen, for a person.
        expected: What would have been right; empty for what any process owes here.
        action: What to do about it, a full sentence; empty for what helps with any such fault.

    Attributes:
        expected: What such a process owes.
        action: What its author should do next, a full sentence.
    """

    exit_code = 2

    def __init__(self, fault: Fault, found: str, expected: str = "", action: str = "") -> None:
        self.fault = fault
        self.found = found
        self.expected = expected or EXPECTED[fault]
        self.action = action or ACTION.get(fault, LOOK)
        super().__init__(f"{self.seen}, expected {self.expected}. {self.action}")

    @property
    def seen(self) -> str:
        """Kind and what was seen, as evidence says it."""
        return f"the policy's process is at fault ({self.fault}): {self.found}"

    def __reduce__(self) -> tuple[type["PolicyError"], tuple[Fault, str, str, str]]:
        """Keep all fields when the error crosses a process boundary."""
        return type(self), (self.fault, self.found, self.expected, self.action)
