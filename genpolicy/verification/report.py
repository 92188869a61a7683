"""What the checker answers: violations with event and sentence, and how much it looked at."""

from collections import Counter
from dataclasses import dataclass, field

Point = tuple[float, float, float]


@dataclass(frozen=True)
class Violation:
    """One broken invariant.

    Attributes:
        session: Rollout.
        event: Number of the event in its session.
        rule: Invariant, as in `P1.age`.
        text: What is wrong there, a sentence.
    """

    session: str
    event: int
    rule: str
    text: str


@dataclass(frozen=True)
class JournalReport:
    """What `checker.json` says of a journal; meanings as in `CheckReport`."""

    violations: list[Violation]
    sessions: int
    events: int
    checked_actions: int
    checked_fallback_actions: int
    reproved_actions: int
    chunks: int
    discarded: dict[str, int]
    oldest_action_s: float
    longest_silence_s: float


@dataclass(frozen=True)
class Reached:
    """What `envelope.json` says of the commands of a method; None without commands.

    Attributes:
        commands: How many were accepted.
        fastest_m_s: Longest way from a command to the next one, over one period, m/s.
        lowest_m: Lowest x, y, z commanded, m.
        highest_m: Highest.
    """

    commands: int
    fastest_m_s: float | None
    lowest_m: Point | None
    highest_m: Point | None


@dataclass
class CheckReport:
    """Outcome over all sessions of one or more journals.

    Attributes:
        violations: Every broken invariant, in order.
        sessions: Sessions read.
        events: Events read.
        checked_actions: Actions of policies that the stub accepted, each proved.
        checked_fallback_actions: The same for the fallback.
        reproved_actions: Of both, those whose motion was proved feasible again.
        chunks: Chunks that arrived.
        discarded: Chunks discarded by reason.
        oldest_action_ns: Largest action age found.
        longest_silence_ns: Longest time from an accepted action to the next command or hold.
        checks_missing: Checks that a session ran without; anything here is a violation too.
    """

    violations: list[Violation] = field(default_factory=list)
    sessions: int = 0
    events: int = 0
    checked_actions: int = 0
    checked_fallback_actions: int = 0
    reproved_actions: int = 0
    chunks: int = 0
    discarded: Counter[str] = field(default_factory=Counter)
    oldest_action_ns: int = 0
    longest_silence_ns: int = 0
    checks_missing: set[str] = field(default_factory=set)

    def as_document(self) -> JournalReport:
        """For `checker.json`."""
        return JournalReport(
            violations=list(self.violations),
            sessions=self.sessions,
            events=self.events,
            checked_actions=self.checked_actions,
            checked_fallback_actions=self.checked_fallback_actions,
            reproved_actions=self.reproved_actions,
            chunks=self.chunks,
            discarded=dict(sorted(self.discarded.items())),
            oldest_action_s=self.oldest_action_ns / 1e9,
            longest_silence_s=self.longest_silence_ns / 1e9,
        )
