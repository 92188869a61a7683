"""What a session remembers of the invocation that it waits for, and what it counts."""

from collections import Counter
from dataclasses import dataclass, field

from genpolicy.contract.chunk import ChunkMetadata
from genpolicy.feasibility.admission import Admitted


@dataclass
class Asked:
    """An invocation that has not been decided.

    Attributes:
        metadata: Of the chunk that is to come.
        row: Row of the replay that it was asked at.
        asked_s: When, s.
        answered_s: When the answer came, s; None before.
        admitted: The chunk, where it passed; it is delivered when its first row is the next.
        first_row: Row of the replay that its first checked action is for.
    """

    metadata: ChunkMetadata
    row: int
    asked_s: float
    answered_s: float | None = None
    admitted: Admitted | None = None
    first_row: int = 0


@dataclass
class Tally:
    """What is counted beside the journal.

    Attributes:
        dropped: What was not used, by reason.
        decided_s: From each answer to the decision on it, s.
        late_s: How late each tick was, s.
        again: Verdicts that came behind their row, and were asked for once more.
    """

    dropped: Counter[str] = field(default_factory=Counter)
    decided_s: list[float] = field(default_factory=list)
    late_s: list[float] = field(default_factory=list)
    again: int = 0
