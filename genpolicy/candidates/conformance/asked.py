"""Answers of a policy behind the wire at recorded moments, and what went wrong."""

from collections import Counter

from genpolicy.candidates.conformance.recorded_starts import RecordedStarts
from genpolicy.candidates.wire.extension import NoiseName
from genpolicy.candidates.wire.faults import PolicyError
from genpolicy.candidates.wire.remote import Invocation, RemotePolicy

AGAIN = 16
"""Moments that are asked a second time, and after a new start."""


class Asked:
    """Answers by moment.

    Attributes:
        answers: By number of the moment.
        faults: How many questions ended in each kind of fault.
        last: What the last of them was.
    """

    def __init__(self) -> None:
        self.answers: dict[int, Invocation] = {}
        self.faults: Counter[str] = Counter()
        self.last = ""

    def ask(self, policy: RemotePolicy, starts: RecordedStarts, row: int, candidates: int) -> None:
        """One moment; a fault is counted."""
        name: NoiseName = ("conformance", row)
        try:
            self.answers[row] = policy.invoke(
                starts.observations[row], noise=name, candidates=candidates
            )
        except PolicyError as error:
            self.faults[str(error.fault)] += 1
            self.last = error.found


def asked_again(
    policy: RemotePolicy, starts: RecordedStarts, first: Asked, candidates: int
) -> Asked:
    """Some of the moments a second time, last one first, on a line of its own."""
    policy.close()
    asked = Asked()
    for row in sorted(first.answers, reverse=True)[:: max(1, len(first.answers) // AGAIN)]:
        asked.ask(policy, starts, row, candidates)
    return asked
