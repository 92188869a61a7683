"""A person who has the arm, followed again: what may move it meanwhile, and what counts after it.

From the call on nothing of the policy is executed or taken into the queue; the person's chunks are
executed while the person has the arm and at no other time; coming and going clears no stop, and
goes with the state of recovery that says so; and an episode in which somebody was called is no
success of the policy.

An outcome is a word of whoever wrote it. It calls for a person only at the time at which recovery
asks one or gives up, it is assisted only where one was called, and a stop only where the supervisor
stopped at that time: else an episode could be ended before it succeeds, or before it is stopped.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from genpolicy.seeds import stream
from genpolicy.verification.journal_source import Message, read_messages
from genpolicy.verification.names import is_a_name
from genpolicy.verification.recovering import ABORTED, ASKED, IDLE, PERSON, STOPPED, Recovering

Finding = tuple[str, str]
BEGINS = "took_over"
GONE = {"handed_back": IDLE, "gave_up": ABORTED, "episode_over": "ended"}
"""Ways to leave the arm: the state of recovery, or the mode, that is entered with each."""
STOPS = ("protective_stop", "emergency_stop")
CALLED, DRIVEN = "intervention", "fallback"
"""Modes of the executor: somebody is called, the classical plan drives."""
FALLBACK = "fallback"
"""Whose chunks recovery drives by where no person has the arm."""
SUCCESS, ASSISTED = "success", "assisted"
STOPPED_BY = {"collision": "collision", "force_stop": "force"}
"""Outcomes that are stops, and the event of the supervisor that is each."""
NS_PER_S = 1_000_000_000
ROUNDING_NS = 2.0


class Attended:
    """Follows who has the arm in one session."""

    def __init__(self) -> None:
        self._who = ""
        self._mode = "run"
        self._stopped = False
        self._stop: tuple[int, str] | None = None
        self._since_ns: int | None = None
        self._recovering = Recovering()
        self._methods: dict[int, str] = {}
        # What a person's coming or going, or a call, must be followed by in the same tick.
        self._owed: tuple[int, str] | None = None
        self._asked_ns: int | None = None

    def follow(self, kind: str, m: Message) -> Iterator[Finding]:
        """Take an event in; yields what is wrong with it while, or after, a person has the arm."""
        yield from self._overdue(kind, m["t"])
        yield from self._recovering.follow(kind, m)
        if kind == "person":
            yield from self._person(m)
        elif kind == "recovery":
            yield from self._recovery(m)
        elif kind == "mode":
            yield from self._change_mode(m)
        elif kind == "supervisor":
            self._stopped = m["state"] in STOPS
            self._stop = (m["t"], m["event"]) if self._stopped else None
            if m["event"] == "human_reset" and self._who:
                yield "P8.reset", f"A stop is cleared while {self._who!r} has the arm."
        elif kind == "enqueue":
            self._methods[m["arrival"]] = m["method"]
            if self._mode == CALLED:
                yield "P8.queue", f"{m['chunk_id']!r} comes, and somebody is called."
            elif self._who and m["method"] != self._who:
                yield "P8.queue", f"{m['chunk_id']!r} comes while {self._who!r} has the arm."
        elif kind in ("accept", "fallback"):
            by = self._methods.get(m["arrival"], "")
            if self._who and by != self._who:
                yield "P8.drives", f"An action of {by!r} is executed, {self._who!r} has the arm."
            elif not self._who and kind == DRIVEN and by != FALLBACK:
                yield "P8.drives", f"An action of {by!r} is executed, who has not the arm."
        elif kind == "outcome":
            yield from self._outcome(m["outcome"], m["t"])

    def _outcome(self, how: str, now_ns: int) -> Iterator[Finding]:
        """A word for which there was no reason on record at that time."""
        called = self._recovering.called
        if how == SUCCESS and called:
            yield "P8.success", "An episode in which a person was called counts as success."
        elif how == ASSISTED and not called:
            yield "P8.outcome", "An episode counts as assisted, and nobody was called."
        elif how == CALLED and not _gives_up(self._recovering.state, self._since_ns, now_ns):
            state = self._recovering.state
            yield "P8.outcome", f"An episode ends for want of a person in state {state!r}."
        elif how in STOPPED_BY and self._stop != (now_ns, STOPPED_BY[how]):
            yield "P7.outcome", f"An episode ends by {how!r}, and no such stop is on record then."

    def _overdue(self, kind: str, now_ns: int) -> Iterator[Finding]:
        """What had to follow in the tick that is over."""
        if self._owed is not None and (now_ns > self._owed[0] or kind == "end"):
            yield "P8.person", f"A person came or went, and {self._owed[1]!r} was not entered."
            self._owed = None
        if self._asked_ns is not None and (now_ns > self._asked_ns or kind == "end"):
            yield "P8.called", f"A person is asked, and the mode stays {self._mode!r}."
            self._asked_ns = None

    def _person(self, m: Message) -> Iterator[Finding]:
        if m["stage"] == BEGINS:
            asked = self._recovering.state == ASKED and self._mode == CALLED
            if self._who or not asked or not is_a_name(m["who"]):
                yield "P8.take_over", f"{m['who']!r} takes over in mode {self._mode!r}."
            if self._stopped:
                yield "P8.stop", f"{m['who']!r} takes over while a stop stands."
            self._who, self._owed = str(m["who"]), (m["t"], PERSON)
        elif m["stage"] in GONE and m["who"] == self._who:
            self._who, self._owed = "", (m["t"], GONE[m["stage"]])
        else:
            yield "P8.person", f"{m['who']!r} {m['stage']}, and {self._who!r} had the arm."

    def _recovery(self, m: Message) -> Iterator[Finding]:
        """A person's state begins and ends with that person's coming and going."""
        with_it = self._owed == (m["t"], m["new"])
        if PERSON in (m["old"], m["new"]) and m["new"] != STOPPED and not with_it:
            yield "P8.person", f"Recovery goes to {m['new']!r}, and no person came or went."
        if with_it:
            self._owed = None
        self._asked_ns = m["t"] if m["new"] == ASKED and self._mode != CALLED else None
        self._since_ns = m["t"]

    def _change_mode(self, m: Message) -> Iterator[Finding]:
        if (m["old"], m["new"]) == (CALLED, DRIVEN):
            if self._owed != (m["t"], PERSON):
                yield "P8.mode", "From a call the plan drives on, and nobody took over."
        elif self._who:
            yield "P8.mode", f"Mode {m['new']!r} is entered while {self._who!r} has the arm."
        if self._owed == (m["t"], m["new"]):
            self._owed = None
        if m["new"] == CALLED:
            self._asked_ns = None
        self._mode = m["new"]


def _gives_up(state: str, since_ns: int | None, now_ns: int) -> bool:
    """Whether recovery has just come to where nothing but a person helps."""
    return state in (ASKED, ABORTED) and since_ns == now_ns


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
    """Calls, times of coming and going, ns, and the end of one rollout."""

    condition: str
    start: int
    period_ns: int
    called: list[int] = field(default_factory=list)
    over: dict[int, int] = field(default_factory=dict)
    came: dict[int, int] = field(default_factory=dict)
    since_ns: int = 0
    had_ns: int = 0
    recovery: tuple[str, int | None] = (IDLE, None)
    outcome: str = ""
    given_up: str = ""

    def read(self, kind: str, m: Message) -> None:
        """Take an event in."""
        if kind == "recovery":
            self.recovery = (m["new"], m["t"])
        elif kind == "outcome":
            self.outcome = m["outcome"]
            self.given_up = self.recovery[0] if _gives_up(*self.recovery, m["t"]) else ""
        if kind == "recovery" and m["new"] == ASKED:
            self.called.append(m["t"])
        elif (kind == "recovery" and m["old"] == ASKED) or kind == "end":
            self.over.setdefault(len(self.called) - 1, m["t"])
        elif kind == "person" and m["stage"] == BEGINS:
            self.came[len(self.called) - 1] = self.since_ns = m["t"]
        elif kind == "person":
            self.had_ns += m["t"] - self.since_ns

    def otherwise(self, plan: PlannedPerson | None) -> Iterator[str]:
        """What came otherwise than planned, or did not come."""
        # Where one is planned a call is waited for: only who does not come, or gives up, ends it.
        ends = (ABORTED,) if plan else (ASKED, ABORTED)
        if self.outcome == CALLED and self.given_up not in ends:
            yield "an episode ends for want of a person, whom recovery does not miss at that time"
        if self.outcome == ASSISTED and (plan is None or not self.called):
            yield "an outcome is assisted, and nobody was called who was planned"
        if plan is None:
            if self.came:
                yield "a person took over, and none was planned"
            return
        if -1 in self.came:
            yield "a person took over, and none was called"
        for call, called_ns in enumerate(self.called):
            draw = stream(plan.root_seed, "person", self.condition, self.start, call)
            due_s = draw.uniform(*plan.reaction_s)
            tick = math.ceil(due_s * NS_PER_S / self.period_ns - 1e-6)
            due_ns = called_ns + tick * self.period_ns
            # The period is told in whole ns, and a tick may be any number.
            near_ns = ROUNDING_NS + tick / 2
            came_ns, over_ns = self.came.get(call), self.over.get(call)
            if came_ns is None:
                if over_ns is None or due_ns + near_ns < over_ns:
                    yield f"nobody took over, due at {due_ns / NS_PER_S:.3f} s"
            elif not abs(came_ns - due_ns) <= near_ns:
                told = f"{came_ns / NS_PER_S:.3f} s, due at {due_ns / NS_PER_S:.3f} s"
                yield f"a person took over at {told}"
        # The tick at which the time is over is the first one behind it.
        if self.had_ns > plan.longest_s * NS_PER_S + self.period_ns + ROUNDING_NS:
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
