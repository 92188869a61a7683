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


class PolicyError(GenpolicyError):
    """A policy's process failed an invocation; there is no chunk, and nothing of ours is broken.

    Args:
        fault: Which kind.
        found: What was seen, for a person.
    """

    exit_code = 2

    def __init__(self, fault: Fault, found: str) -> None:
        self.fault = fault
        self.found = found
        super().__init__(f"the policy's process is at fault ({fault}): {found}")

    def __reduce__(self) -> tuple[type["PolicyError"], tuple[Fault, str]]:
        """Keep both fields when the error crosses a process boundary."""
        return type(self), (self.fault, self.found)
