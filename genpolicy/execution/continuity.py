"""Continuity: is the way from the last command to the next row one that feasibility checked?

It checked the ways between the rows of a chunk, and the one from the last command of its own
moment to the first row that it was asked about. After a row that was left out, another command in
between, or a hold, nobody has checked anything, and the chunk needs a new admission. Where no
command says where the arm is (in a new session, after a person, a stop or a reset), the chunk was
checked from where it is seen, and from a motion that is known. Executor and controller stub each
keep their own.

A hold is half a period more than the one that a command lasts, by the clock; and one by the
watchdog, or for a clock that is doubted, however short, since that clock measured nothing. A loop
that asks several times a period is told to hold for what is not due yet: that alone is none.
"""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.action import POSITION
from genpolicy.execution.moment import Chunk, View
from genpolicy.execution.nanoseconds import NEVER_NS

if TYPE_CHECKING:
    from genpolicy.feasibility.admission import Admitted

STILL_RAD = 1e-6
"""Joints of one pose, from solutions that began elsewhere."""
BOUNDARY_COMMANDS = 2
"""Commands before the last one that the rates at a seam rest on."""
Array = NDArray[np.float64]


class Given(NamedTuple):
    """The action that the controller was given last.

    Attributes:
        chunk: The very chunk that it was a row of.
        row: Which row.
        action: Its bytes.
    """

    chunk: object
    row: int
    action: bytes


class Continuity:
    """What was commanded last, as the asking place knows it.

    Attributes:
        given_ns: When an action was given last; None before the first.
    """

    def __init__(self) -> None:
        self.given_ns: int | None = None
        self._last: Given | None = None
        self._resumed_ns = NEVER_NS
        self._held_ns: int | None = None
        self._commands = 0

    def note(self, now_ns: int, chunk: "Admitted", row: int, action: Array) -> None:
        """The controller was given a row."""
        self._last, self.given_ns = Given(chunk, row, bytes_of(action)), now_ns
        self._held_ns = None
        self._commands += 1

    def held(self, at_ns: int = NEVER_NS) -> None:
        """The watchdog holds, or a clock is doubted, and then nobody knows since when.

        What is held and goes on at one moment was not interrupted.
        """
        self._held_ns = at_ns if self._held_ns is None else min(self._held_ns, at_ns)

    def forget(self) -> None:
        """A person moves the arm, or has: no command says where it is."""
        self._last, self._commands = None, 0

    def after(self, resumed_ns: int) -> None:
        """A stop was cleared at this time: the arm stands where the brakes or a person left it."""
        if resumed_ns != self._resumed_ns:
            self._resumed_ns = resumed_ns
            self.forget()

    def follows(self, chunk: "Admitted", about: Chunk, row: int, now_ns: int, view: View) -> bool:
        """Whether feasibility checked the way from the last command to a row.

        Args:
            chunk: Whose row it is.
            about: What is known of the chunk.
            row: The row.
            now_ns: Time.
            view: The present; where the arm was seen last.
        """
        last, holds = self._last, self._holds(now_ns, about.times.period_ns)
        if last is not None and last.chunk is chunk:
            return row == last.row + 1 and holds == 0
        if row != about.checked_rows[0]:
            return False
        context = getattr(chunk, "context", None)
        if last is None:
            return begins_here(context, view) and moves_known(context)
        told = bytes_of(getattr(context, "last_action", None))
        before = self._commands - 1 + holds
        return told == last.action and rests(context, holds) and knows(context, before)

    def _holds(self, now_ns: int, period_ns: int) -> int:
        """Periods for which the arm was held since the last command."""
        if self.given_ns is None:
            return 0
        held = self._held_ns is not None and self._held_ns < now_ns
        return max(round((now_ns - self.given_ns) / period_ns) - 1, int(held))


def begins_here(context: object, view: View) -> bool:
    """Whether a chunk was checked from where the arm is seen, as far as it may be off a command.

    Asked where no command says where it is. Where nobody says where it was seen, or the chunk does
    not say from where it was checked, nobody knows.
    """
    try:
        told = np.asarray(getattr(context, "last_action", None), dtype=float)[POSITION]
        away_m = float(np.linalg.norm(told - np.asarray(view.tcp_m, dtype=float)))
    except (TypeError, ValueError, IndexError):
        return False
    return away_m <= view.divergence_limit_m


def rests(context: object, holds: int) -> bool:
    """Whether a chunk was checked from an arm that has stood still for so many periods.

    Its joints were commanded to one place for as long, as far as it says; without a hold it may
    come from any motion, and where it says nothing it rests on nothing.
    """
    if holds <= 0:
        return True
    try:
        command = np.asarray(getattr(context, "q_cmd", None), dtype=float)
        before = np.asarray(getattr(context, "q_cmd_history", None), dtype=float)[-holds:]
        return bool(np.all(np.abs(before - command) <= STILL_RAD))
    except (TypeError, ValueError, IndexError):
        return False


def knows(context: object, before: int) -> bool:
    """Whether a chunk was checked with the commands before the last one, of so many that were.

    Acceleration at the seam rests on one of them and jerk on two; of what is left out feasibility
    assumes nothing, and asks nothing.
    """
    try:
        told = np.asarray(getattr(context, "q_cmd_history", None), dtype=float)
    except (TypeError, ValueError):
        return before <= 0
    return (len(told) if told.ndim else 0) >= min(before, BOUNDARY_COMMANDS)


def moves_known(context: object) -> bool:
    """Whether a chunk says how the arm moved where it begins: by commands before, or as measured.

    Asked where no command says it. Where neither is told feasibility asks for no acceleration: the
    arm could be told to reach the speed of its joints within one period.
    """
    return getattr(context, "dq_meas", None) is not None or knows(context, BOUNDARY_COMMANDS)


def bytes_of(values: object) -> bytes:
    """Little-endian float64 bytes of numbers; empty of anything else."""
    try:
        return np.ascontiguousarray(values, dtype="<f8").tobytes()
    except (TypeError, ValueError):
        return b""
