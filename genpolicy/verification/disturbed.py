"""Whether what was to happen to the cell happened: pushes, and the drill of a recovery.

Times and sizes are drawn again from the named streams of the root seed, in other words than the
rollout's. A condition whose push never comes looks like one that was met.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from genpolicy.seeds import stream
from genpolicy.verification.journal_source import Message, read_messages

NS_PER_S = 1_000_000_000
ROUNDING_NS = 1_000
OPEN_S, CONTACT_S, DRILL_S = (0.3, 1.5), (0.8, 1.8), (0.5, 3.0)
"""When each comes, s: after the start, after the first tick in contact, after the start."""
DURATION_S = 0.2
IDLE = "idle"
Pushed = tuple[int, float, float, bool]
"""When, ns; sideways force, N, signed; how long, s; whether it waited for contact."""


@dataclass(frozen=True)
class Plan:
    """What was to happen.

    Attributes:
        perturbations: The planned ones, by name: `kind` and its fields.
        contact_phases: Phases in which there is contact.
        root_seed: Root seed of the ladder.
    """

    perturbations: Mapping[str, Mapping[str, Any]]
    contact_phases: frozenset[str]
    root_seed: int


@dataclass
class _Session:
    """One rollout while its events go by."""

    condition: str
    start: int
    period_ns: int
    ticks: list[tuple[int, str]] = field(default_factory=list)
    pushed: list[Pushed] = field(default_factory=list)
    drills_ns: list[int] = field(default_factory=list)
    busy: list[tuple[int, str]] = field(default_factory=list)
    end_ns: int = 0

    def read(self, kind: str, m: Message) -> None:
        """Take an event in."""
        if kind == "observation":
            self.ticks.append((m["t"], str(m["phase"])))
        elif kind == "push":
            self.pushed.append((m["t"], m["force_n"], m["duration_s"], m["in_contact"]))
        elif kind == "recovery":
            self.busy.append((m["t"], str(m["new"])))
            if m["cause"] == "drill":
                self.drills_ns.append(m["t"])
        elif kind == "end":
            self.end_ns = m["t"]

    def owed(self, plan: Plan) -> list[Pushed]:
        """The pushes that this rollout lived to see."""
        planned = plan.perturbations[self.condition]
        if planned["kind"] != "push":
            return []
        draw = stream(plan.root_seed, "push", self.condition, self.start)
        found = []
        touched_ns = next((t for t, phase in self.ticks if phase in plan.contact_phases), None)
        for size_n, window_s, since_ns in (
            (planned["force_n"], OPEN_S, 0),
            (planned.get("contact_force_n", 0.0), CONTACT_S, touched_ns),
        ):
            force_n = size_n if draw.random() < 0.5 else -size_n
            due_s = window_s[0] + (window_s[1] - window_s[0]) * draw.random()
            if size_n == 0.0 or since_ns is None:
                continue
            tick_ns = self._tick_from(since_ns + due_s * NS_PER_S)
            if tick_ns is not None:
                found.append((tick_ns, force_n, DURATION_S, window_s is CONTACT_S))
        return sorted(found)

    def _tick_from(self, due_ns: float) -> int | None:
        """The first tick that is not before; None where the rollout had ended by then."""
        later = (t for t, _ in self.ticks if t >= due_ns - ROUNDING_NS)
        return next((t for t in later if t < self.end_ns), None)

    def drill_missed(self, due_ns: float) -> bool:
        """Whether a tick went by at which recovery was due and idle, and it stayed so."""
        idle_since_ns: float | None = -self.period_ns
        for t, state in [*self.busy, (self.end_ns, "")]:
            if idle_since_ns is not None:
                first_ns = max(idle_since_ns + self.period_ns, due_ns)
                tick_ns = self._tick_from(first_ns)
                if tick_ns is not None and tick_ns < t:
                    return True
            idle_since_ns = t if state == IDLE else None
            if t in self.drills_ns:
                return False
        return False


def disturbed_otherwise(path: Path, plan: Plan) -> Iterator[str]:
    """What happened to the cell in a journal of rollouts that was not planned, or did not happen.

    Raises:
        IntegrityError: No regular file.
        BadInputError: Not a whole journal.
        KeyError, TypeError, ValueError: An event that cannot be read.
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
        owed = session.owed(plan)
        if not _same(session.pushed, owed):
            yield f"{name!r} was pushed {_said(session.pushed)}, {_said(owed)} by the plan"
        yield from _drilled(name, session, plan)


def _drilled(name: str, session: _Session, plan: Plan) -> Iterator[str]:
    done_ns = session.drills_ns
    if plan.perturbations[session.condition]["kind"] != "recovery_drill":
        if done_ns:
            yield f"{name!r} had a drill at {done_ns[0] / NS_PER_S:.3f} s, and none by the plan"
        return
    draw = stream(plan.root_seed, "drill", session.condition, session.start)
    due_ns = (DRILL_S[0] + (DRILL_S[1] - DRILL_S[0]) * draw.random()) * NS_PER_S
    when = f"due at {due_ns / NS_PER_S:.3f} s"
    if len(done_ns) > 1 or any(t < due_ns - ROUNDING_NS for t in done_ns):
        yield f"{name!r} had drills at {done_ns} ns, one {when}"
    elif session.drill_missed(due_ns):
        yield f"{name!r} was idle when its drill was {when}, and had none at that tick"


def _same(found: list[Pushed], owed: list[Pushed]) -> bool:
    """Whether both are the same pushes, in their order."""
    return len(found) == len(owed) and all(
        abs(one[0] - other[0]) <= ROUNDING_NS
        and all(math.isclose(a, b, rel_tol=1e-9) for a, b in zip(one[1:3], other[1:3], strict=True))
        and one[3] is other[3]
        for one, other in zip(found, owed, strict=True)
    )


def _said(pushes: list[Pushed]) -> str:
    told = (f"{force_n:+g} N at {t / NS_PER_S:.3f} s" for t, force_n, _, _ in pushes)
    return ", ".join(told) or "never"
