"""A person who has the arm, followed again: what may move it meanwhile, and what counts after it.

From the call on nothing of the policy is executed or taken into the queue; the person's chunks are
executed while the person has the arm and at no other time; coming and going clears no stop; and an
episode in which a person had the arm is no success of the policy.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from genpolicy.seeds import stream
from genpolicy.verification.journal_source import Message, read_messages

Finding = tuple[str, str]
TOOK, GONE = "took_over", ("handed_back", "gave_up", "episode_over")
STOPS = ("protective_stop", "emergency_stop")
SUCCESS = "success"
NS_PER_S = 1_000_000_000


class Attended:
    """Follows who has the arm in one session."""

    def __init__(self) -> None:
        self._who = ""
        self._mode = "run"
        self._stopped = self._helped = False
        self._methods: dict[int, str] = {}
        self._people: set[str] = set()

    def follow(self, kind: str, m: Message) -> Iterator[Finding]:
        """Take an event in; yields what is wrong with it while, or after, a person has the arm."""
        if kind == "person":
            yield from self._person(m)
        elif kind == "mode":
            if self._who and not (m["old"] == "intervention" and m["new"] == "fallback"):
                yield "P8.mode", f"Mode {m['new']!r} is entered while {self._who!r} has the arm."
            self._mode = m["new"]
        elif kind == "supervisor":
            self._stopped = m["state"] in STOPS
            if m["event"] == "human_reset" and self._who:
                yield "P8.reset", f"A stop is cleared while {self._who!r} has the arm."
        elif kind == "enqueue":
            self._methods[m["arrival"]] = m["method"]
            if self._who and m["method"] != self._who:
                yield "P8.queue", f"{m['chunk_id']!r} comes while {self._who!r} has the arm."
        elif kind in ("accept", "fallback"):
            by = self._methods.get(m["arrival"], "")
            if self._who and by != self._who:
                yield "P8.drives", f"An action of {by!r} is executed, {self._who!r} has the arm."
            if by != self._who and by in self._people:
                yield "P8.drives", f"An action of {by!r} is executed, who has not the arm."
        elif kind == "outcome" and self._helped and m["outcome"] == SUCCESS:
            yield "P8.success", "An episode in which a person had the arm counts as success."

    def _person(self, m: Message) -> Iterator[Finding]:
        if m["stage"] == TOOK:
            if self._who or self._mode != "intervention" or not str(m["who"]).strip():
                yield "P8.take_over", f"{m['who']!r} takes over in mode {self._mode!r}."
            if self._stopped:
                yield "P8.stop", f"{m['who']!r} takes over while a stop stands."
            self._who, self._helped = str(m["who"]), True
            self._people.add(self._who)
        elif m["stage"] in GONE and m["who"] == self._who:
            self._who = ""
        else:
            yield "P8.person", f"{m['who']!r} {m['stage']}, and {self._who!r} had the arm."


@dataclass(frozen=True)
class PlannedPerson:
    """Who was to come.

    Attributes:
        reaction_s: Least and most time from a call until the arm is taken over, s.
        longest_s: How long the arm may be had in one rollout, s.
        root_seed: Root seed of the ladder.
    """

    reaction_s: tuple[float, float]
    longest_s: float
    root_seed: int


@dataclass
class _Session:
    """Calls, and times of coming and going, of one rollout, ns."""

    condition: str
    start: int
    period_ns: int
    called: list[int] = field(default_factory=list)
    came: list[tuple[int, int]] = field(default_factory=list)
    had_ns: int = 0

    def read(self, kind: str, m: Message) -> None:
        """Take an event in."""
        if kind == "recovery" and m["new"] == "ask_human":
            self.called.append(m["t"])
        elif kind == "person" and m["stage"] == TOOK:
            self.came.append((len(self.called) - 1, m["t"]))
        elif kind == "person":
            self.had_ns += m["t"] - self.came[-1][1]

    def otherwise(self, plan: PlannedPerson | None) -> Iterator[str]:
        """What came otherwise than planned."""
        if plan is None:
            if self.came:
                yield "a person took over, and none was planned"
            return
        for call, came_ns in self.came:
            draw = stream(plan.root_seed, "person", self.condition, self.start, call)
            due_s = draw.uniform(*plan.reaction_s)
            tick = math.ceil(due_s * NS_PER_S / self.period_ns - 1e-6)
            due_ns = self.called[call] + tick * self.period_ns
            if came_ns != due_ns:
                told = f"{came_ns / NS_PER_S:.3f} s, due at {due_ns / NS_PER_S:.3f} s"
                yield f"a person took over at {told}"
        # The tick at which the time is over is the first one behind it.
        if self.had_ns > plan.longest_s * NS_PER_S + self.period_ns:
            yield f"a person had the arm for {self.had_ns / NS_PER_S:.3f} s"


def attended_otherwise(path: Path, plan: PlannedPerson | None) -> Iterator[str]:
    """What of the person in a journal of rollouts was not planned.

    Raises:
        IntegrityError: No regular file.
        BadInputError: Not a whole journal.
        KeyError, IndexError, TypeError, ValueError: An event that cannot be read.
    """
    sessions: dict[str, _Session] = {}
    for kind, m in read_messages(path):
        name = str(m.get("session"))
        if kind == "session":
            labels = m["labels"]
            own = (str(labels["perturbation"]), int(labels["start"]))
            sessions[name] = _Session(*own, int(m["period_ns"]))
        else:
            sessions[name].read(kind, m)
    for name, session in sessions.items():
        for found in session.otherwise(plan):
            yield f"in {name!r} {found}"
