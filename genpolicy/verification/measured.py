"""What a cell measured of itself: once a tick, and in agreement with all else that was measured.

A rollout states its measured state at every tick and where it ends. Here that is held against the
joints that chunks were checked from, the observations that the policy saw (whose bytes are proved
by their hashes), the peaks of the force, by MuJoCo's kinematics against itself, from tick to tick
against how fast the joints can turn, and how far an observation says that the arm is from the last
command: a state that was made up afterwards has to fit all six.

Not proved is what lies between: an arm that moved otherwise from one observation or checked chunk
to the next, and no faster than it can; an opening of the gripper that no policy saw; and a force
below the largest so far.
"""

import math
from bisect import insort
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from genpolicy.verification.arrived import TIMED
from genpolicy.verification.journal_source import Message, floats
from genpolicy.verification.motion import MotionProof
from genpolicy.verification.pose import POSITION, two_columns

Array = NDArray[np.float64]
Finding = tuple[str, str]
ROUNDING = 1e-6
"""A state has six decimals."""
POSE_TOLERANCE = 1e-5
"""Of m and of the numbers of a rotation: what six decimals of every joint may move the TCP by."""


@dataclass(frozen=True)
class _State:
    """One state that was stated."""

    q_rad: Array
    pose: Array
    force_n: float


class Measured:
    """Follows the measured states of one session.

    Args:
        proof: Knows the robot; None: joints and TCP are not held together, joints may turn as
            fast as is stated, and what the policy saw is not held against states.
    """

    def __init__(self, proof: MotionProof | None = None) -> None:
        self._proof = proof
        self._timed = False
        self._states: dict[int, _State] = {}
        self._arrived: list[int] = []
        self._last_ns = self._felt_ns = -1
        self._peak_n = 0.0
        self._commanded_m: Array | None = None
        self._period_ns = 0
        self._scenes: dict[int, Mapping[str, str]] = {}

    def follow(self, kind: str, m: Message) -> Iterator[Finding]:
        """Take an event in; yields where a state is missing, or another than was measured."""
        if kind == "session":
            self._timed, self._period_ns = TIMED in m["labels"], m.get("period_ns", 0)
        elif not self._timed:
            return
        elif kind == "state":
            yield from self._state(m)
        elif kind in ("scene", "arrived", "accept", "fallback"):
            self._take(kind, m)
        elif kind in ("exposure", "end"):
            if m["t"] != self._last_ns:
                yield "state.missing", f"No state is stated at {m['t']} ns."
        elif kind == "force":
            self._peak_n, self._felt_ns = max(self._peak_n, m["force_n"]), m["t"]
            if self._felt_ns == self._last_ns:
                yield from self._felt(self._states[self._last_ns].force_n)
        elif kind == "enqueue" and m["motion"] is not None:
            yield from self._checked_from(m)
        elif kind == "conditioning":
            yield from self._seen(m)
        elif kind == "observation":
            yield from self._diverged(m)
            yield from self._located(m)

    def _take(self, kind: str, m: Message) -> None:
        """What others hold to account, and states are held against."""
        if kind == "scene":
            self._scenes[m["t"]] = m["bodies"]
        elif kind == "arrived":
            insort(self._arrived, m["exposed_ns"])
        else:
            self._commanded_m = floats(m["action"])[POSITION]

    def _state(self, m: Message) -> Iterator[Finding]:
        q_rad, tcp_m, turned = (
            np.array(m[name], dtype=np.float64) for name in ("q_rad", "tcp_m", "tcp_rotation")
        )
        pose = np.array([*tcp_m, *turned, m["gripper_m"]])
        state = _State(q_rad, pose, float(m["force_n"]))
        if not all(map(math.isfinite, [*q_rad, *pose, state.force_n])):
            yield "state.number", "What is measured is no number."
            return
        if not m["t"] > self._last_ns:
            yield "state.again", f"At {m['t']} ns more is stated than once a tick."
        elif self._proof is not None and self._states:
            yield from self._turned(state, (m["t"] - self._last_ns) / 1e9)
        self._states[m["t"]], self._last_ns = state, m["t"]
        yield from self._felt(state.force_n)
        if self._proof is not None:
            position, rotation = self._proof.forward(q_rad)
            off = max(
                float(np.max(np.abs(position - tcp_m))),
                float(np.max(np.abs(two_columns(rotation) - turned))),
            )
            if not off <= POSE_TOLERANCE:
                yield (
                    "state.pose",
                    f"The joints put the TCP elsewhere than is stated, by {off:.3g}.",
                )

    def _turned(self, state: _State, since_s: float) -> Iterator[Finding]:
        """No joint turned faster since the state before than it can."""
        assert self._proof is not None
        turned = np.abs(state.q_rad - self._states[self._last_ns].q_rad)
        if not np.all(turned <= self._proof.expected.arm_rates[0] * since_s + 2 * ROUNDING):
            yield "state.speed", f"The joints turn by {turned.tolist()} rad in {since_s:.3g} s."

    def _felt(self, force_n: float) -> Iterator[Finding]:
        """No state is above the peak on record, and a new peak is the state of its tick."""
        more_n = force_n - self._peak_n
        if not (more_n <= ROUNDING and (self._felt_ns != self._last_ns or more_n >= -ROUNDING)):
            yield "state.force", f"{force_n} N is stated, and the peak is {self._peak_n} N."

    def _diverged(self, m: Message) -> Iterator[Finding]:
        """What an observation says that the arm is off is what lies between state and command."""
        state = self._states.get(m["t"])
        if state is None or self._commanded_m is None:
            return
        own_m = float(np.linalg.norm(state.pose[POSITION] - self._commanded_m))
        told_m = m["divergence_m"]
        if told_m is None or not abs(told_m - own_m) <= 2 * ROUNDING:
            yield "state.divergence", f"The arm is {own_m:.6g} m off, {told_m} m are noted."

    def _located(self, m: Message) -> Iterator[Finding]:
        """Where an observation says that the TCP is, the state has it."""
        state = self._states.get(m["t"])
        if state is not None and not _same(state.pose[POSITION], np.array(m["tcp_m"], dtype=float)):
            yield "state.place", f"An observation has the TCP at {m['tcp_m']}."

    def _checked_from(self, m: Message) -> Iterator[Finding]:
        motion = m["motion"]
        state, q_rad = self._states.get(motion["measured_ns"]), floats(motion["q_meas_rad"])
        if state is None or not _same(state.q_rad, q_rad):
            yield (
                "state.joints",
                f"{m['chunk_id']!r} was checked from other joints than are stated.",
            )
            return
        before_ns = motion["measured_ns"] - self._period_ns
        # A period need not be a whole number of ns, and each tick is rounded.
        times_ns = (before_ns + off_ns for off_ns in (0, 1, -1, 2, -2))
        before = next((self._states[t] for t in times_ns if t in self._states), None)
        told = motion.get("dq_meas_rad_s")
        if before is None or before is state:
            if told is not None:
                yield "state.velocity", f"{m['chunk_id']!r} states a velocity of one state."
            return
        period_s = self._period_ns / 1e9
        moved = (state.q_rad - before.q_rad) / period_s
        # Both joint positions of each have six decimals.
        if told is None or not np.all(np.abs(floats(told) - moved) <= 2 * ROUNDING / period_s):
            yield (
                "state.velocity",
                f"{m['chunk_id']!r} was checked at another velocity.",
            )

    def _seen(self, m: Message) -> Iterator[Finding]:
        """Each row of what was seen has TCP and opening of its tick; the first may be repeated."""
        rows, seen = int(m["rows"]), self._arrived[-int(m["rows"]) :]
        if not seen or seen[-1] != m["exposed_ns"]:
            yield "state.seen", f"Invocation {m['id']!r} saw what is not the newest that is there."
            return
        pose_of = None if self._proof is None else self._proof.expected.seen
        if pose_of is None:
            return
        history = floats(m["history"]).reshape(rows, -1)
        for row, tick_ns in zip(history, [seen[0]] * (rows - len(seen)) + seen, strict=True):
            yield from self._placed(m, row, tick_ns)
            state = self._states.get(tick_ns)
            if state is None or not _same(state.pose, pose_of(row)):
                yield (
                    "state.seen",
                    f"Invocation {m['id']!r} saw the TCP of {tick_ns} ns otherwise than stated.",
                )

    def _placed(self, m: Message, row: Array, tick_ns: int) -> Iterator[Finding]:
        """The scene of a tick is the one that its observation shows."""
        poses_of = None if self._proof is None else self._proof.expected.placed
        if poses_of is None:
            return
        told, shown = self._scenes.get(tick_ns, {}), poses_of(row)
        if told.keys() != shown.keys() or not all(
            _same(floats(told[name]), np.concatenate([np.ravel(part) for part in shown[name]]))
            for name in shown
        ):
            yield "state.scene", f"Invocation {m['id']!r} saw the scene of {tick_ns} ns otherwise."


def _same(stated: Array, measured: Array) -> bool:
    return stated.shape == measured.shape and bool(np.all(np.abs(stated - measured) <= ROUNDING))
