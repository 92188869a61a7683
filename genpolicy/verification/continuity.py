"""From the last command on, every step is one that was checked, at the pace it was checked at.

A chunk says from which command it was checked; its rows were checked one after the other. What
the controller was given must go that way, whatever the clock says.
"""

import struct
from collections.abc import Iterator

from genpolicy.verification.journal_source import Message

Finding = tuple[str, str]
RULE, PACE = "P5.continuity", "P5.pace"


class Continuity:
    """Follows what the controller accepted in one session."""

    def __init__(self) -> None:
        self._last: tuple[int, int, str] | None = None
        self._accepted_ns: int | None = None

    def forget(self) -> None:
        """Somebody else moves the arm, or has: no command says where it is."""
        self._last = None

    def follow(self, chunk: Message, m: Message, period_ns: int) -> Iterator[Finding]:
        """Take an accepted action of a chunk in; yields what nobody checked about it."""
        last, motion, row = self._last, chunk["motion"], m["row"]
        if last is not None and last[0] == m["arrival"]:
            if row != last[1] + 1:
                yield RULE, f"Row {row} follows row {last[1]}: nobody checked that step."
        elif row != chunk["checked_rows"][0]:
            yield RULE, f"Row {row} comes first, and is not the first that was checked."
        elif last is not None and motion is not None and motion["last_action"] != last[2]:
            yield RULE, f"{chunk['chunk_id']!r} was checked from another command."
        since_ns = self._accepted_ns
        if last is not None and last[0] != m["arrival"] and motion is not None:
            holds = round((m["t"] - (since_ns or 0)) / period_ns) - 1
            if holds > 0 and not _stood_still(motion, holds):
                yield RULE, f"{chunk['chunk_id']!r} was checked in motion, after {holds} holds."
        if since_ns is not None and 10 * (m["t"] - since_ns) < 9 * period_ns:
            yield PACE, f"Two actions are {m['t'] - since_ns} ns apart."
        self._last, self._accepted_ns = (m["arrival"], row, m["action"]), m["t"]


def _stood_still(motion: Message, holds: int) -> bool:
    """Whether the commands that a chunk says it was checked behind were one place for so long."""
    here, before = (
        struct.unpack(f"<{len(motion[key]) // 16}d", bytes.fromhex(motion[key]))
        for key in ("q_cmd_rad", "q_before_rad")
    )
    told = before[-holds * len(here) :]
    return all(abs(value - here[n % len(here)]) <= 1e-6 for n, value in enumerate(told))
