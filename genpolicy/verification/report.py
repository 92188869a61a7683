"""What the checker answers: violations with event and sentence, and how much it looked at."""

from collections import Counter
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Violation:
    """One broken invariant.

    Attributes:
        session: Rollout.
        event_index: Number of the event in its session.
        rule: Invariant, as in `P1.age`.
        sentence: What is wrong there.
    """

    session: str
    event_index: int
    rule: str
    sentence: str


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

    def as_document(self) -> dict[str, Any]:
        """For `checker.json`."""
        return {
            "violations": [
                {"session": v.session, "event": v.event_index, "rule": v.rule, "text": v.sentence}
                for v in self.violations
            ],
            "sessions": self.sessions,
            "events": self.events,
            "checked_actions": self.checked_actions,
            "checked_fallback_actions": self.checked_fallback_actions,
            "reproved_actions": self.reproved_actions,
            "chunks": self.chunks,
            "discarded": dict(sorted(self.discarded.items())),
            "oldest_action_s": self.oldest_action_ns / 1e9,
            "longest_silence_s": self.longest_silence_ns / 1e9,
        }
