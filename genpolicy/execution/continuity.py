"""Continuity: is the way from the last command to the next row one that feasibility checked?

It checked the ways between the rows of a chunk, and the one from the last command of its own
moment to the first row that it was asked about. After a row that was left out, or another command
in between, nobody has checked anything, and the chunk needs a new admission. Executor and
controller stub each keep their own.
"""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from genpolicy.feasibility.admission import Admitted

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

    def note(self, now_ns: int, chunk: "Admitted", row: int, action: Array) -> None:
        """The controller was given a row."""
        self._last, self.given_ns = Given(chunk, row, bytes_of(action)), now_ns

    def forget(self) -> None:
        """A person moves the arm, or has: no command says where it is."""
        self._last = None

    def follows(self, chunk: "Admitted", first: int, row: int) -> bool:
        """Whether feasibility checked the way from the last command to a row.

        Args:
            chunk: Whose row it is.
            first: The first row that was checked.
            row: The row.
        """
        last = self._last
        if last is not None and last.chunk is chunk:
            return row == last.row + 1
        if row != first:
            return False
        return last is None or bytes_of(_told(chunk)) == last.action


def bytes_of(values: object) -> bytes:
    """Little-endian float64 bytes of numbers; empty of anything else."""
    try:
        return np.ascontiguousarray(values, dtype="<f8").tobytes()
    except (TypeError, ValueError):
        return b""


def _told(chunk: "Admitted") -> object:
    """The last command that the chunk was checked from; None where it says none."""
    return getattr(getattr(chunk, "context", None), "last_action", None)
