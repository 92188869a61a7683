"""Answers of a policy behind the wire at recorded moments, and what went wrong."""

from collections import Counter

from genpolicy.candidates.conformance.recorded_starts import RecordedStarts
from genpolicy.candidates.wire.extension import NoiseName
from genpolicy.candidates.wire.faults import PolicyError
from genpolicy.candidates.wire.policy import GONE_AFTER
from genpolicy.candidates.wire.remote import Invocation, RemotePolicy

AGAIN = 16
"""Moments that are asked a second time, and after a new start."""
UNASKED = ("gone", f"not asked any more after {GONE_AFTER} faults in a row")
"""Kind and text of a moment that is not asked any more."""


PINGS = 9
"""Of which the longest is what the wire may take."""


class Asked:
    """Answers by moment.

    Attributes:
        answers: By number of the moment.
        failures: Kind of the fault and what was seen, by number of the moment.
    """

    def __init__(self) -> None:
        self.answers: dict[int, Invocation] = {}
        self.failures: dict[int, tuple[str, str]] = {}
        self._in_a_row = 0

    @property
    def faults(self) -> Counter[str]:
        """How many questions ended in each kind of fault."""
        return Counter(kind for kind, _ in self.failures.values())

    @property
    def last(self) -> str:
        """What the last fault was, of a question that was asked."""
        asked = (said for said in reversed(self.failures.values()) if said != UNASKED)
        return next(asked, ("", ""))[1]

    def before(self, row: int) -> "Asked":
        """What was answered, and what went wrong, at the moments before one."""
        part = Asked()
        part.answers = {at: one for at, one in self.answers.items() if at < row}
        part.failures = {at: one for at, one in self.failures.items() if at < row}
        return part

    def ask(self, policy: RemotePolicy, starts: RecordedStarts, row: int, candidates: int) -> None:
        """One moment; a fault is counted, and after many in a row nobody is asked any more."""
        if self._in_a_row >= GONE_AFTER:
            self.failures[row] = UNASKED
            return
        name: NoiseName = ("conformance", row)
        try:
            self.answers[row] = policy.invoke(
                starts.observations[row], noise=name, candidates=candidates
            )
        except PolicyError as error:
            self.failures[row] = (str(error.fault), error.found)
            self._in_a_row += 1
        else:
            self._in_a_row = 0


def asked_first(policy: RemotePolicy, starts: RecordedStarts, candidates: int) -> Asked:
    """Every moment, in their order: one of each episode first."""
    asked = Asked()
    for row in range(len(starts)):
        asked.ask(policy, starts, row, candidates)
    return asked


def asked_again(
    policy: RemotePolicy, starts: RecordedStarts, first: Asked, candidates: int
) -> Asked:
    """Some of the first moment of each episode a second time, last one first, on another line.

    Which ones does not depend on the answers; who gave none at first has none to repeat.
    """
    policy.close()
    asked = Asked()
    for row in reversed(repeated(starts.apart)):
        if row in first.answers:
            asked.ask(policy, starts, row, candidates)
    return asked


def repeated(apart: int) -> list[int]:
    """The moments that are asked again, of so many that are each of another episode."""
    return list(range(apart))[:: max(1, apart // AGAIN)]


def round_trips(policy: RemotePolicy) -> list[float]:
    """How long the wire itself takes, s, a few times; none where pings are not answered."""
    found: list[float] = []
    for _ in range(PINGS):
        try:
            lasted = policy.round_trip_s()
        except PolicyError:
            return []  # what is wrong will be seen when it is asked
        if lasted is None:
            return []
        found.append(lasted)
    return found
