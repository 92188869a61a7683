"""What was true when: phase, calibration, weights, stops and voiding events, followed again."""

import math
from collections.abc import Callable, Iterator
from functools import partial

from genpolicy.verification.arrived import TIMED
from genpolicy.verification.expected import ExpectedSettings
from genpolicy.verification.journal_source import Message
from genpolicy.verification.moved import moved_m
from genpolicy.verification.names import is_a_name
from genpolicy.verification.recovering import Failed

Finding = tuple[str, str]
STOP_STATES = ("protective_stop", "emergency_stop")
ROUNDING_N = 1e-6
"""A state has six decimals."""
STATES = frozenset({"run", "watchdog_hold", *STOP_STATES})
STOPPING = frozenset({"force", "collision", "emergency_stop", "silence", "restarted"})
"""Events of a supervisor that leave it in a stop."""
EVENTS = STOPPING | {"human_reset", "watchdog", "watchdog_recovered", "reset_refused"}
CHANGES = ("phase", "epoch")
MODES = ("run", "fallback", "intervention", "ended")
VOIDING = (
    "force_event", "collision_event", "observation_divergence", "intervention", "stopped",
)  # fmt: skip
"""Reasons for which an executor says that what is older is void."""
KINDS = frozenset({
    "observation", "phase", "epoch", "active", "invocation", "candidate", "refuse", "supervisor",
    "recovery", "invalidate", "mode", "reset", "force", "outcome", "scene", "controller",
    "conditioning", "push", "joined", "recovery_force", "person", "exposure", "arrived",
    "state", "latency",
})  # fmt: skip


class WorldView:
    """The checker's own picture of the present, built from raw events.

    Args:
        expected: What the caller knows of it; None: no measured force is too much.

    Attributes:
        fallback_hash: Identity of the fallback planner, as declared by the session.
        divergence_limit_m: What the measured TCP may be off the commanded one, likewise.
    """

    def __init__(self, expected: ExpectedSettings | None = None) -> None:
        self._limits_n = expected.force_limit_n if expected else None
        self._felt_n, self._most_n, self._felt_ns = 0.0, math.inf, -1
        self.fallback_hash = ""
        self.divergence_limit_m = 0.0
        self.phase = self.epoch = ""
        self.newest_ns: int | None = None
        self.active = ("", "")
        self.session_epoch = 0
        self.mode = "run"
        self.controller = ""
        self.stopped = False
        self._strayed_ns: int | None = None
        self.scene: dict[str, str] | None = None
        self._begun_in: dict[str, dict[str, str] | None] | None = {}
        self.void_before: dict[str, int] = {}
        self._arrivals = 0
        self._void_arrivals: dict[str, int] = {}
        self._changes: dict[str, tuple[str, str, int]] = {}
        self._state = "run"
        self._refusal: tuple[object, ...] = ()
        self._followed: dict[str, Callable[[Message], Iterator[Finding]]] = {
            "observation": self._observe, "mode": self._change_mode, "reset": self._reset,
            "supervisor": self._supervise, "controller": self._change_controller,
            "recovery": Failed().follow,
            "phase": partial(self._note, "phase"), "epoch": partial(self._note, "epoch"),
            "candidate": self._judge, "invalidate": self._invalidate, "refuse": self._refuse,
        }  # fmt: skip

    def declare(self, settings: Message) -> None:
        """Take in what the session is held to."""
        self.fallback_hash = settings["fallback_hash"]
        self.divergence_limit_m = settings["maximum_divergence_m"]
        if TIMED in settings.get("labels", {}):
            self._begun_in = None

    def follow(self, kind: str, m: Message, arrivals: int = 0) -> Iterator[Finding]:
        """Take an event in; yields what is wrong with the event itself.

        Args:
            kind: Of the event.
            m: The event.
            arrivals: Chunks that arrived before it.
        """
        self._arrivals = arrivals
        if self._changes and kind not in CHANGES:
            yield from self.unnoted()
        if kind not in KINDS:
            yield "journal.kind", f"There is no event of kind {kind!r}."
        elif kind in self._followed:
            yield from self._followed[kind](m)
        elif kind == "state":
            self._felt_n, self._felt_ns = m["force_n"], m["t"]
            self._most_n = self._bears_n()
        elif kind == "scene":
            self.scene = m["bodies"]
        elif kind == "invocation" and m["stage"] == "begin" and self._begun_in is not None:
            self._begun_in[m["id"]] = self.scene
        elif kind == "active":
            self.active = (m["checkpoint"], m["sampler"])
        elif kind == "outcome" and not self.stopped:
            yield from self._unheard()

    def scenes_of(self, chunk_id: str) -> tuple[dict[str, str] | None, ...]:
        """In which of the scenes on record a chunk may have been checked.

        The newest; where no virtual clock stands still for the check, also the one in which its
        invocation began. How far it has moved since is asked of each action (P1.scene).
        """
        return self.scene, (self._begun_in or {}).get(chunk_id)

    def unnoted(self) -> Iterator[Finding]:
        """What the newest observation changed and no event says; once."""
        for name, (old, new, _) in self._changes.items():
            yield f"journal.{name}", f"It changed from {old!r} to {new!r}, and nobody notes it."
        self._changes.clear()

    def objections(self, chunk: Message, kind: str, t: int, settings: Message) -> Iterator[Finding]:
        """Why an action of this chunk may not be accepted at `t`; nothing if it may."""
        seen_ns = chunk["condition_ns"]
        age_ns = t - seen_ns
        limit_ns = settings["maximum_age_ns"].get(self.phase)
        if not age_ns >= 0 or self.newest_ns is None or seen_ns > self.newest_ns:
            yield "P1.future", f"It rests on an observation of {seen_ns} ns, not yet seen."
        if limit_ns is None or not limit_ns - age_ns >= 0:
            yield "P1.age", f"The action is {age_ns} ns old, allowed are {limit_ns} in this phase."
        if chunk["phase"] != self.phase:
            yield "P1.phase", f"The chunk is for {chunk['phase']!r}, the phase is {self.phase!r}."
        if chunk["calibration_epoch"] != self.epoch:
            yield "P1.calibration", f"The chunk is of epoch {chunk['calibration_epoch']!r}."
        expected = self.active if kind == "accept" else (self.fallback_hash, self.fallback_hash)
        if chunk["checkpoint"] != expected[0]:
            yield "P1.checkpoint", "The chunk was made by other weights than the active ones."
        if chunk["sampler"] != expected[1]:
            yield "P1.sampler", "The chunk was made by another sampler than the active one."
        if chunk["session_epoch"] != self.session_epoch:
            yield "P1.session", f"The chunk is of session epoch {chunk['session_epoch']}."
        source = {"accept": "policy", "fallback": "fallback"}[kind]
        needed = {"accept": "run", "fallback": "fallback"}[kind]
        if chunk["source"] != source or self.mode != needed:
            yield "P1.state", f"A {chunk['source']} action in mode {self.mode!r}."
        if not self.controller or self.controller != settings["controller_mode"]:
            yield "P1.controller", f"The controller is in mode {self.controller!r}."
        if self.stopped:
            yield "P7.stop", "An action is accepted while the supervisor stops."
        yield from self._unheard()
        # A chunk that does not say what it was checked in is a violation of its own (P6.ground).
        shift_m = moved_m(chunk["motion"]["scene"], self.scene) if chunk["motion"] else 0.0
        if not shift_m <= settings["maximum_scene_shift_m"]:
            yield "P1.scene", f"A body has moved by {shift_m:.3g} m since the chunk was checked."
        yield from self._voided(chunk)

    def _unheard(self) -> Iterator[Finding]:
        """A force beyond what the phase bears, of which nobody heard: it goes on, or ends well."""
        if not self._felt_n <= self._most_n + ROUNDING_N:
            yield "P7.force", f"{self._felt_n} N are measured, the phase bears {self._most_n} N."

    def _voided(self, chunk: Message) -> Iterator[Finding]:
        seen_ns, arrival, motion = chunk["condition_ns"], chunk["arrival"], chunk["motion"]
        measured_ns = motion["measured_ns"] if motion else seen_ns
        for cause, before_ns in self.void_before.items():
            if seen_ns < before_ns:
                yield "P1.void", f"{cause} at {before_ns} ns voids an observation of {seen_ns} ns."
            elif measured_ns < before_ns:
                yield "P1.void", f"{cause} at {before_ns} ns voids joints of {measured_ns} ns."
            # What is as new as the event is void all the same if it was here when it happened.
            elif arrival < self._void_arrivals[cause]:
                yield "P1.void", f"{cause} at {before_ns} ns voids what had arrived, as {arrival}."

    def place_of(self, m: Message, queued: bool) -> str:
        """Where a chunk was discarded: at the stub if that has just refused it for this reason."""
        refused = self._refusal == (m["arrival"], m["chunk_id"], m["reason"], m["t"])
        return "arrival" if not queued else "stub" if refused else "queue"

    def _refuse(self, m: Message) -> Iterator[Finding]:
        self._refusal = (m["arrival"], m["chunk_id"], m["reason"], m["t"])
        yield from ()

    def _invalidate(self, m: Message) -> Iterator[Finding]:
        before_ns = m["t"]
        if m["reason"] != "observation_divergence":
            self._void(f"a {m['reason']}", before_ns)
        else:
            before_ns = self._strayed_ns
            if before_ns is None:
                yield "journal.divergence", "A divergence is noted, and none was observed."
        if m["reason"] not in VOIDING:
            yield "journal.void", f"Nothing is void for {m['reason']!r}."
        if before_ns not in (None, m["before_ns"]):
            yield "journal.void", f"What is older than {before_ns} ns is void, {m['before_ns']}."

    def _note(self, kind: str, m: Message) -> Iterator[Finding]:
        """What the newest observation changed is noted once, as it was."""
        noted, own = (m.get("old"), m["new"], m.get("event_time_ns")), self._changes.pop(kind, None)
        if noted != own:
            yield f"journal.{kind}", f"{noted} is noted, observed was {own or 'no change'}."

    @staticmethod
    def _judge(m: Message) -> Iterator[Finding]:
        """A candidate is refused where a layer is not passed, and then has a reason."""
        passed = bool(m["layers"]) and all(ok is True for ok in m["layers"].values())
        if passed == bool(m["first_reason"]):
            yield (
                "journal.verdict",
                f"{m['chunk_id']!r} has the layers {m['layers']} and the reason "
                f"{m['first_reason']!r}.",
            )

    def _change_mode(self, m: Message) -> Iterator[Finding]:
        if m["new"] not in MODES:
            yield "journal.mode", f"There is no mode {m['new']!r}."
        if m["old"] != self.mode:
            yield "journal.mode", f"Mode {m['old']!r} is left, but {self.mode!r} was entered."
        self.mode = m["new"]
        if m["new"] == "run":
            self._void(f"the end of {m['old']}", m["t"])

    def _change_controller(self, m: Message) -> Iterator[Finding]:
        if not isinstance(m["mode"], str):
            yield "journal.controller", f"The controller's mode is {m['mode']!r}."
        if self.controller not in ("", m["mode"]):
            self._void("another mode of the controller", m["t"])
        self.controller = m["mode"]

    def _reset(self, m: Message) -> Iterator[Finding]:
        if m["session_epoch"] <= self.session_epoch:
            yield "P3.session", f"Session epoch {m['session_epoch']} after {self.session_epoch}."
        self.session_epoch = m["session_epoch"]
        self.newest_ns = None
        self._void("a reset", m["t"])

    def _observe(self, m: Message) -> Iterator[Finding]:
        event_ns, t = m["event_time_ns"], m["t"]
        late = self.newest_ns is not None and event_ns < self.newest_ns
        used = event_ns <= t and not late
        why = "" if used else "future" if event_ns > t else "older"
        if (used, why) != (m["used"], m["ignored_because"]):
            yield "journal.observation", f"An observation of {event_ns} ns, used: {m['used']}."
        self._strayed_ns = None
        if self._has_strayed(m["divergence_m"]):
            # Of an observation that was not used nothing is known but that it is here now.
            self._strayed_ns = event_ns if used else t
            self._void("an observation divergence", self._strayed_ns)
        if not used:
            return
        if self.newest_ns is not None:
            if m["phase"] != self.phase:
                self._void("a phase transition", event_ns)
            if m["calibration_epoch"] != self.epoch:
                self._void("a calibration change", event_ns)
        self._changes = {
            kind: (old, new, event_ns)
            for kind, old, new in (
                ("phase", self.phase, m["phase"]), ("epoch", self.epoch, m["calibration_epoch"]),
            )
            if old != new
        }  # fmt: skip
        self.newest_ns = event_ns
        self.phase, self.epoch = m["phase"], m["calibration_epoch"]
        if self._felt_ns == t:  # felt on the way from one phase to the other: neither may be passed
            self._most_n = min(self._most_n, self._bears_n())

    def _bears_n(self) -> float:
        """What may be felt in this phase; nothing in one that nobody names, before the first all.

        Before the first observation there is no phase, and nothing that was made in one.
        """
        if self._limits_n is None or not self.phase:
            return math.inf
        return self._limits_n.get(self.phase, 0.0)

    def _has_strayed(self, away_m: float | None) -> bool:
        """Whether the arm is not where it was sent; where nobody says, nothing is known."""
        return away_m is not None and not 0.0 <= away_m <= self.divergence_limit_m

    def _supervise(self, m: Message) -> Iterator[Finding]:
        reset = m["event"] == "human_reset"
        if reset and not is_a_name(m["detail"]):
            yield "P7.reset", "A stop is cleared without a person."
        now_stopped, stopping = m["state"] in STOP_STATES, m["event"] in STOPPING
        if m["state"] not in STATES or m["event"] not in EVENTS:
            yield "P7.words", f"No supervisor says {m['event']!r} in {m['state']!r}."
        elif not self.stopped and not self._leads(m["event"], m["state"]):
            yield "P7.state", f"In {self._state!r} comes {m['event']!r}, and then {m['state']!r}."
        self._state = m["state"]
        if stopping and not now_stopped:
            rule = "P7.restart" if m["event"] == "restarted" else "P7.gate"
            yield rule, f"A {m['event']} event leaves {m['state']!r}, not stopped."
        if self.stopped and not now_stopped and not reset:
            yield "P7.sticky", f"A {m['event']} event clears a stop."
        if now_stopped or stopping:
            self._void("a stop", m["t"])
        elif reset:
            # Of a reset behind no stop nothing is thrown away that was seen as late as it.
            self._void("a stop", m["t"], arrivals=0)
        # Whatever it says of itself: only a person clears a stop, and these events are one.
        self.stopped = now_stopped or stopping or (self.stopped and not reset)

    def _leads(self, event: str, state: str) -> bool:
        """Whether an event of a supervisor that stops nobody leads to this state."""
        if event in STOPPING:
            return True  # a violation of its own, where it does not stop (P7.gate)
        if event == "watchdog":
            return (self._state, state) == ("run", "watchdog_hold")
        if event == "reset_refused":
            return state == self._state
        return state == "run" and (event == "human_reset" or self._state == "watchdog_hold")

    def _void(self, cause: str, before_ns: int, arrivals: int | None = None) -> None:
        """What was seen before an event is void, and what had arrived when it happened."""
        arrivals = self._arrivals if arrivals is None else arrivals
        self.void_before[cause] = max(before_ns, self.void_before.get(cause, before_ns))
        self._void_arrivals[cause] = max(arrivals, self._void_arrivals.get(cause, 0))
