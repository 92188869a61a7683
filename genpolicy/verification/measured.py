"""What a cell measured of itself: once a tick, and in agreement with all else that was measured.

A rollout states its measured state at every tick and where it ends. Here that is held against the
joints that chunks were checked from, the observations that the policy saw (whose bytes are proved
by their hashes), the peaks of the force, and by MuJoCo's kinematics against itself: a state that
was made up afterwards has to fit all four.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.rotation import rotation_to_6d
from genpolicy.verification.journal_source import Message, floats

Array = NDArray[np.float64]
Finding = tuple[str, str]
Forward = Callable[[Array], tuple[Array, Array]]
"""Position (3,), m, and rotation (3, 3) of the TCP from joint positions (J,), rad."""
TIMED = "start_sha256"
"""The label of a session that runs on the virtual clock."""
ROUNDING = 1e-6
"""A state has six decimals."""
POSE_TOLERANCE = 1e-5
"""Of m and of the numbers of a rotation: what six decimals of every joint may move the TCP by."""


@dataclass(frozen=True)
class _State:
    """One state that was stated."""

    q_rad: Array
    tcp_m: Array
    force_n: float


class Measured:
    """Follows the measured states of one session.

    Args:
        forward: Where the TCP is by joint positions; None: joints and TCP are not held together.
    """

    def __init__(self, forward: Forward | None = None) -> None:
        self._forward = forward
        self._timed = False
        self._states: dict[int, _State] = {}
        self._last_ns = self._felt_ns = -1
        self._peak_n = 0.0

    def follow(self, kind: str, m: Message) -> Iterator[Finding]:
        """Take an event in; yields where a state is missing, or another than was measured."""
        if kind == "session":
            self._timed = TIMED in m["labels"]
        elif not self._timed:
            return
        elif kind == "state":
            yield from self._state(m)
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

    def _state(self, m: Message) -> Iterator[Finding]:
        state = _State(np.array(m["q_rad"]), np.array(m["tcp_m"]), float(m["force_n"]))
        turned = np.array(m["tcp_rotation"])
        numbers = [*state.q_rad, *state.tcp_m, *turned, m["gripper_m"], state.force_n]
        if not all(map(math.isfinite, numbers)):
            yield "state.number", "What is measured is no number."
            return
        if not m["t"] > self._last_ns:
            yield "state.again", f"At {m['t']} ns more is stated than once a tick."
        self._states[m["t"]], self._last_ns = state, m["t"]
        yield from self._felt(state.force_n)
        if self._forward is not None:
            position, rotation = self._forward(state.q_rad)
            off = max(
                float(np.max(np.abs(position - state.tcp_m))),
                float(np.max(np.abs(rotation_to_6d(rotation) - turned))),
            )
            if not off <= POSE_TOLERANCE:
                yield (
                    "state.pose",
                    f"The joints put the TCP elsewhere than is stated, by {off:.3g}.",
                )

    def _felt(self, force_n: float) -> Iterator[Finding]:
        """No state is above the peak on record, and a new peak is the state of its tick."""
        more_n = force_n - self._peak_n
        if not (more_n <= ROUNDING and (self._felt_ns != self._last_ns or more_n >= -ROUNDING)):
            yield "state.force", f"{force_n} N is stated, and the peak is {self._peak_n} N."

    def _checked_from(self, m: Message) -> Iterator[Finding]:
        motion = m["motion"]
        state, q_rad = self._states.get(motion["measured_ns"]), floats(motion["q_meas_rad"])
        if state is None or not _same(state.q_rad, q_rad):
            yield (
                "state.joints",
                f"{m['chunk_id']!r} was checked from other joints than are stated.",
            )

    def _seen(self, m: Message) -> Iterator[Finding]:
        """The observed position of the TCP is one of an observation's channels, side by side."""
        state, seen = self._states.get(m["exposed_ns"]), floats(m["history"])
        newest = seen[-(len(seen) // max(int(m["rows"]), 1)) :]
        threes = np.lib.stride_tricks.sliding_window_view(np.pad(newest, 1), 3)
        if state is None or not np.any(np.all(np.abs(threes - state.tcp_m) <= ROUNDING, axis=1)):
            yield "state.seen", f"Invocation {m['id']!r} saw the TCP elsewhere than is stated."


def _same(stated: Array, measured: Array) -> bool:
    return stated.shape == measured.shape and bool(np.all(np.abs(stated - measured) <= ROUNDING))
