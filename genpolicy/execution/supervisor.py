"""The supervisor: force and collision gate, watchdog, protective stop, E-stop.

It knows no policy, no chunk and no score; it hears forces, collisions, accepted commands and
people. A stop is sticky: only a named person resets it (Simplex architecture, ASTM F3269: the
monitor carries the assurance, the learned function does not). One that takes over in a running
session cannot know whether a stop stood: it begins stopped.
"""

import math
from enum import StrEnum
from numbers import Real
from typing import NoReturn

import numpy as np

from genpolicy.contract.names import says
from genpolicy.errors import ContractError
from genpolicy.execution.believed import CLOCK_AHEAD
from genpolicy.execution.cell import ExecutionSettings
from genpolicy.execution.checks import CHECKS, Checks, Place, refusal
from genpolicy.execution.journal import Journal
from genpolicy.execution.moment import Moment
from genpolicy.execution.nanoseconds import to_ns
from genpolicy.execution.observed import name_of


class SupervisorState(StrEnum):
    """What the supervisor allows."""

    RUN = "run"
    WATCHDOG_HOLD = "watchdog_hold"
    PROTECTIVE_STOP = "protective_stop"
    EMERGENCY_STOP = "emergency_stop"


STOPPED = frozenset({SupervisorState.PROTECTIVE_STOP, SupervisorState.EMERGENCY_STOP})
RESET_REFUSED = "reset_refused"
"""What a supervisor says of a person who resets at a time that is doubted; it changes nothing."""
FLAGS = (bool, np.bool_)
LONGEST_TEXT = 120


class DoubtedTimeError(ContractError):
    """A person resets at a time that the session does not believe."""


class Supervisor:
    """Independent gate between whatever commands and the controller stub.

    Args:
        settings: Its limits; none has a default that could be taken for a safe value.
        journal: Where its events go; one that has events is of a session that runs, and of a
            supervisor before this one.
        checks: The table; its rows of the place `SUPERVISOR` are asked.
    """

    def __init__(
        self, settings: ExecutionSettings, journal: Journal, *, checks: Checks = CHECKS
    ) -> None:
        self.settings = settings
        self.state = SupervisorState.RUN
        self.resumed_ns = -(1 << 62)
        self.stops = 0
        self.checks = checks
        self._journal = journal
        self._watchdog_ns = to_ns(settings.watchdog_s)
        silence_s = settings.silence_stop_s
        self._silence_ns = None if silence_s is None else to_ns(silence_s)
        self._last_accept_ns: int | None = None
        self._before_n = math.inf
        if len(journal):
            self._stop(journal.latest_ns, SupervisorState.PROTECTIVE_STOP, "restarted", "")

    @property
    def stopped(self) -> bool:
        """Whether a protective stop or an E-stop stands."""
        return self.state in STOPPED

    def observe_force(self, now_s: float, force_n: float, phase: str) -> bool:
        """Force gate; trips a protective stop above the phase's limit, and on what is no force.

        A force since the last call was felt in the phase of that call or in this one: where they
        differ the smaller limit holds.

        Args:
            now_s: Time, s.
            force_n: Largest contact force since the last call, N.
            phase: Current task phase.

        Returns:
            Whether it tripped.
        """
        here_n = self._bears_n(phase)
        limit_n, self._before_n = min(here_n, self._before_n), here_n
        if _is_borne(force_n, limit_n):
            return False
        detail = f"{_text(force_n)} N {_text(phase)}"
        self._stop(self._journal.clock(now_s), SupervisorState.PROTECTIVE_STOP, "force", detail)
        return True

    def _bears_n(self, phase: str) -> float:
        return self.settings.force_limit_n.get(name_of(phase), 0.0)

    def observe_collision(self, now_s: float, collision: bool) -> bool:
        """Collision gate; trips a protective stop, unless told that there is none.

        Returns:
            Whether it tripped.
        """
        if type(collision) in FLAGS and not collision:
            return False
        self._stop(self._journal.clock(now_s), SupervisorState.PROTECTIVE_STOP, "collision", "")
        return True

    def emergency_stop(self, now_s: float, detail: str = "") -> None:
        """E-stop, by a person or for any cause named in `detail`; from every state."""
        now_ns = self._journal.clock(now_s)
        self._stop(now_ns, SupervisorState.EMERGENCY_STOP, "emergency_stop", _text(detail))

    def human_reset(self, now_s: float, person: str) -> None:
        """Clear a stop; the only way back to RUN, and it needs a name.

        A clock that stays far ahead is believed from here on: a person has looked. At any other
        time that is doubted nothing is cleared: nobody would know what was seen before.

        Raises:
            ContractError: No person is named.
            DoubtedTimeError: The time is not believed, on record as `reset_refused`. Where the
                session has believed a clock that was ahead, the person ends it and begins another.
        """
        if not says(person):
            raise ContractError(
                where="supervisor reset",
                found="a reset without a person",
                expected="the name of the person who looked",
                action="Nothing but a person may clear a stop.",
            )
        now_ns = self._journal.believe(now_s)
        if self._journal.doubt:
            self._refuse(now_ns, now_s, person)
        if self.stopped:
            self._last_accept_ns = None  # it stands still until the next accepted command
        self.state = SupervisorState.RUN
        self.resumed_ns = now_ns
        self._record(now_ns, "human_reset", person)

    def _refuse(self, now_ns: int, now_s: float, person: str) -> NoReturn:
        beside, lost = self._journal.beside(now_s), self._journal.is_lost(now_s)
        self._record(now_ns, RESET_REFUSED, f"{self._journal.doubt}, {beside}, by {person}")
        again = "Look at the clock; where it is right, reset again."
        over = "this session believed a clock that was ahead: end it, and begin another one."
        raise DoubtedTimeError(
            where="the time of a supervisor reset",
            found=beside,
            expected="one that the session believes",
            action=f"Look at the clock; where it is right, {over}" if lost else again,
        )

    def note_accepted(self, now_ns: int) -> None:
        """An accepted command: feeds the watchdog and ends a watchdog hold, never a stop."""
        self._last_accept_ns = now_ns
        if self.state is SupervisorState.WATCHDOG_HOLD:
            self.state = SupervisorState.RUN
            self._record(now_ns, "watchdog_recovered", "")

    def doubt(self, now_ns: int, why: str) -> None:
        """A clock that is not believed measures no silence: what was commanded is held.

        Where silence stops, a clock that is far ahead stops too: that long nobody commanded.
        """
        if self._last_accept_ns is None or self.stopped:
            return
        if self._silence_ns is not None and why == CLOCK_AHEAD:
            self._stop(now_ns, SupervisorState.PROTECTIVE_STOP, "silence", why)
        elif self.state is SupervisorState.RUN:
            self.state = SupervisorState.WATCHDOG_HOLD
            self._record(now_ns, "watchdog", why)

    def poll(self, now_ns: int) -> bool:
        """Watchdog, on the consumer's clock. Returns whether it has just begun to hold."""
        if self._last_accept_ns is None or self.stopped:
            return False
        silence_ns = now_ns - self._last_accept_ns
        if self._silence_ns is not None and not self._silence_ns - silence_ns >= 0:
            self._stop(now_ns, SupervisorState.PROTECTIVE_STOP, "silence", f"{silence_ns} ns")
            return False
        moment = Moment(
            now_ns=now_ns, last_accept_ns=self._last_accept_ns, watchdog_ns=self._watchdog_ns
        )
        silent = refusal(self.checks, Place.SUPERVISOR, moment) is not None
        if self.state is SupervisorState.RUN and silent:
            self.state = SupervisorState.WATCHDOG_HOLD
            self._record(now_ns, "watchdog", f"{silence_ns} ns")
            return True
        return False

    def _stop(self, now_ns: int, state: SupervisorState, event: str, detail: str) -> None:
        if self.state is not SupervisorState.EMERGENCY_STOP:
            self.state = state
        self.stops += 1
        self._record(now_ns, event, detail)

    def _record(self, now_ns: int, event: str, detail: str) -> None:
        payload = {"event": event, "state": str(self.state), "detail": detail}
        self._journal.add("supervisor", now_ns, payload)


def _is_borne(force_n: object, limit_n: float) -> bool:
    """Whether it is a force within the limit. A negative, an unknown or a flag was not measured."""
    try:
        if type(force_n) in FLAGS or not isinstance(force_n, Real):
            return False
        return 0.0 <= float(force_n) <= limit_n
    except Exception:  # of whatever it is, reading it may raise anything
        return False


def _text(value: object) -> str:
    """Whatever it is as a short text; what goes on record must not stand in the way of a stop."""
    try:
        return str(value)[:LONGEST_TEXT]
    except Exception:
        return "unreadable"
