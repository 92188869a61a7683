"""Where observations saw the arm, held against the joints that a chunk says were measured.

A chunk states the joints that it was checked from, and when they were measured. They must put the
TCP where an observation of that time measured it. Where the newest observation was made earlier,
the TCP may have gone on since then, as fast as it may. Where nobody saw the arm before the joints
were measured, nobody knows. Joints of another branch with the TCP at the same place are not seen
here: an observation says where the TCP was, and not by which joints.
"""

from collections.abc import Iterator

import numpy as np

from genpolicy.verification.journal_source import Message, floats
from genpolicy.verification.motion import POSE_TOLERANCE_M, MotionProof

Finding = tuple[str, str]
JOINTS = "P5.joints"


class Seen:
    """What the observations of one session say of the place of the TCP.

    Attributes:
        newest_m: Of the observation taken in last; empty where it says none, and before the first.
    """

    def __init__(self) -> None:
        self.newest_m: list[float] = []
        self._places: list[tuple[int, list[float]]] = []

    def take(self, m: Message) -> None:
        """Take in an observation that is used."""
        self.newest_m = m["tcp_m"]
        self._places.append((m["event_time_ns"], m["tcp_m"]))  # none is older than one before

    def forget(self) -> None:
        """What was observed in another session says nothing."""
        self.newest_m = []
        self._places.clear()

    def objections(self, chunk: Message, proof: MotionProof) -> Iterator[Finding]:
        """Whether the measured joints of a chunk put the TCP where it was seen at that time.

        Args:
            chunk: Its `enqueue` event, which says from where it was checked.
            proof: Knows the robot.
        """
        name, motion = repr(chunk["chunk_id"]), chunk["motion"]
        measured_ns = motion["measured_ns"]
        before = [place for place in self._places if place[0] <= measured_ns]
        if not before or len(before[-1][1]) != 3:
            yield JOINTS, f"{name} was checked from joints of a time when nobody saw the arm."
            return
        event_ns, seen_m = before[-1]
        position, _ = proof.forward(floats(motion["q_meas_rad"]))
        away_m = float(np.linalg.norm(position - np.array(seen_m)))
        since_s = (measured_ns - event_ns) / 1e9
        if not away_m <= POSE_TOLERANCE_M + proof.expected.tcp_speed_m_s * since_s:
            yield JOINTS, f"{name} was checked from joints {away_m:.3g} m off where the TCP was."
