"""From the last command on, every step is one that was checked, at the pace it was checked at.

A chunk says from which commands it was checked; its rows were checked one after the other. What
the controller was given must go that way, whatever the clock says. Where the robot is known, the
joints that a chunk says were commanded must be those commands: speed, acceleration and jerk of its
first rows were checked from these joints, and from none that it leaves out.

Where no command says where the arm is (a session begins, a person had it, a stop was cleared, a
reset), the chunk must have been checked from where the newest observation measured the TCP, as
near as the arm may otherwise be to a command, and know how it moved there, by two commands before
or as measured. Where none says, nobody knows. The joints that were
measured for a chunk are held against what was seen at that time, of every chunk (`seen`).

After a hold the arm stands, and what goes on from there was checked from rest, never as the rest of
a chunk. It was held where half a period or more is missing between two actions, and where the
journal says that the watchdog held before the second one, or that a clock was doubted: how long
that took no time on record says.
"""

import struct
from collections import deque
from collections.abc import Iterator
from itertools import chain, repeat

import numpy as np
from numpy.typing import NDArray

from genpolicy.verification.journal_source import Message, floats
from genpolicy.verification.motion import POSE_TOLERANCE_M, POSE_TOLERANCE_RAD, MotionProof
from genpolicy.verification.pose import POSITION, ROTATION, angle_rad, turned_by
from genpolicy.verification.seen import Seen

Array = NDArray[np.float64]
Finding = tuple[str, str]
RULE, PACE, COMMANDS, HERE = "P5.continuity", "P5.pace", "P6.commands", "P5.here"
LATE, DUE = 3, 2
"""Two actions three halves of a period apart, or further, have a hold between them."""
DOUBTED = ("no_time", "clock_backwards", "clock_ahead")
REMEMBERED = 3
"""The last command and two before it: what jerk at a boundary rests on."""


class Continuity:
    """Follows what the controller accepted in one session.

    Args:
        proof: Knows the robot; None: joints are not held against commands.
    """

    def __init__(self, proof: MotionProof | None = None) -> None:
        self._proof = proof
        self._last: tuple[int, int, str] | None = None
        self._accepted_ns: int | None = None
        self._since_ns: list[int] = []
        self._given: deque[tuple[int, Array, Array]] = deque(maxlen=REMEMBERED)
        self._seen = Seen()

    def see(self, kind: str, m: Message) -> None:
        """Take in where an observation that is used measured the TCP."""
        if kind == "observation" and m["used"]:
            self._seen.take(m)

    def forget(self, *, blind: bool = False) -> None:
        """Somebody else moves the arm, or has: no command says where it is.

        Args:
            blind: Nor does what was observed, of another session.
        """
        self._last = None
        self._given.clear()
        if blind:
            self._seen.forget()

    def hold(self, m: Message) -> None:
        """Take in that the controller held."""
        if m["reason"] in DOUBTED:
            self._since_ns.append(-(1 << 62))
        elif m["reason"] == "watchdog":
            self._since_ns.append(m["t"])

    def follow(self, chunk: Message, m: Message, settings: Message) -> Iterator[Finding]:
        """Take an accepted action of a chunk in; yields what nobody checked about it."""
        last, motion, row = self._last, chunk["motion"], m["row"]
        period_ns = settings["period_ns"]
        stood = any(at_ns < m["t"] for at_ns in self._since_ns)
        self._since_ns.clear()
        if last is not None and last[0] == m["arrival"]:
            if row != last[1] + 1:
                yield RULE, f"Row {row} follows row {last[1]}: nobody checked that step."
            elif stood or DUE * (m["t"] - (self._accepted_ns or 0)) >= LATE * period_ns:
                yield RULE, f"Row {row} of {chunk['chunk_id']!r} goes on after a hold."
        elif row != chunk["checked_rows"][0]:
            yield RULE, f"Row {row} comes first, and is not the first that was checked."
        elif motion is not None:
            yield from self._begins(chunk, last, settings["maximum_divergence_m"])
        since_ns = self._accepted_ns
        if last is not None and last[0] != m["arrival"] and motion is not None:
            holds = max(round((m["t"] - (since_ns or 0)) / period_ns) - 1, int(stood))
            if holds > 0 and not _stood_still(motion, holds):
                yield RULE, f"{chunk['chunk_id']!r} was checked in motion, after {holds} holds."
        if since_ns is not None and 10 * (m["t"] - since_ns) < 9 * period_ns:
            yield PACE, f"Two actions are {m['t'] - since_ns} ns apart."
        begins = last is None or last[0] != m["arrival"]
        self._last, self._accepted_ns = (m["arrival"], row, m["action"]), m["t"]
        if self._proof is None or motion is None:
            return
        first, behind = chunk["checked_rows"]
        path, joints = floats(motion["q_rad"]), len(self._proof.expected.torque_nm)
        if motion["joints"] != joints or path.size != (behind - first) * joints:
            return  # a violation of its own (P6.ground)
        if begins:
            yield from self._seen.objections(chunk, self._proof)
            yield from self._from_commands(chunk, m["t"], period_ns, held=stood)
        if first <= row < behind:  # else another one (P1.checked_rows)
            q_rad = path.reshape(-1, joints)[row - first]
            self._given.append((m["t"], floats(m["action"]), q_rad))

    def _begins(
        self, chunk: Message, last: tuple[int, int, str] | None, limit_m: float
    ) -> Iterator[Finding]:
        """Whether it was checked from the last command; without one, from where the arm is seen."""
        told = chunk["motion"]["last_action"]
        if last is not None:
            if told != last[2]:
                yield RULE, f"{chunk['chunk_id']!r} was checked from another command."
            return
        told_m = floats(told)[POSITION]
        seen_m = self._seen.newest_m
        if len(seen_m) != len(told_m):
            yield HERE, f"{chunk['chunk_id']!r} goes on from where nobody says that the arm is."
            return
        away_m = float(np.linalg.norm(told_m - np.array(seen_m)))
        if not away_m <= limit_m:
            yield HERE, f"{chunk['chunk_id']!r} was checked {away_m:.3g} m from the arm."
        motion = chunk["motion"]
        before = len(motion["q_before_rad"]) // max(len(motion["q_cmd_rad"]), 1)
        if motion["dq_meas_rad_s"] is None and before < REMEMBERED - 1:
            yield HERE, f"{chunk['chunk_id']!r} goes on from a motion that nobody knows."

    def _from_commands(
        self, chunk: Message, now_ns: int, period_ns: int, *, held: bool
    ) -> Iterator[Finding]:
        """Whether a chunk was checked from the commands that were in force, newest first."""
        assert self._proof is not None
        name, motion = repr(chunk["chunk_id"]), chunk["motion"]
        before_rad = floats(motion["q_before_rad"]).reshape(-1, motion["joints"])
        told_rad = [floats(motion["q_cmd_rad"]), *before_rad[::-1]][:REMEMBERED]
        given = list(self._in_force(now_ns, period_ns, held=held))[:REMEMBERED]
        if len(told_rad) < len(given):
            yield COMMANDS, f"{name} was checked from {len(told_rad)} of {len(given)} commands."
        if not given:
            given = [(floats(motion["last_action"]), told_rad[0])]
        for back, (q_rad, (action, given_rad)) in enumerate(zip(told_rad, given, strict=False)):
            position, rotation = self._proof.forward(q_rad)
            away_m = float(np.linalg.norm(position - action[POSITION]))
            turned = float(angle_rad(rotation, turned_by(action[ROTATION])))
            if not (away_m <= POSE_TOLERANCE_M and turned <= POSE_TOLERANCE_RAD):
                yield (
                    COMMANDS,
                    f"{name} was checked from joints {away_m:.3g} m and {turned:.3g} rad off the "
                    f"command {back} before the last.",
                )
            elif not np.all(np.abs(q_rad - given_rad) <= self._proof.expected.branch_rad):
                yield COMMANDS, f"{name} was checked from joints of another branch."

    def _in_force(
        self, now_ns: int, period_ns: int, *, held: bool
    ) -> Iterator[tuple[Array, Array]]:
        """Action and joints that were commanded in each period before now, newest first."""
        if held:  # at least for one more, whatever the clock says
            now_ns = max(now_ns, self._given[-1][0] + 2 * period_ns) if self._given else now_ns
        ends_ns = [now_ns, *(given_ns for given_ns, _, _ in list(self._given)[:0:-1])]
        return chain.from_iterable(
            repeat((action, q_rad), min(max(round((end - begun) / period_ns), 1), REMEMBERED))
            for end, (begun, action, q_rad) in zip(ends_ns, reversed(self._given), strict=False)
        )


def _stood_still(motion: Message, holds: int) -> bool:
    """Whether the commands that a chunk says it was checked behind were one place for so long."""
    here, before = (
        struct.unpack(f"<{len(motion[key]) // 16}d", bytes.fromhex(motion[key]))
        for key in ("q_cmd_rad", "q_before_rad")
    )
    told = before[-holds * len(here) :]
    return all(abs(value - here[n % len(here)]) <= 1e-6 for n, value in enumerate(told))
