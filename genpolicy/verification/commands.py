"""How far and how fast the commands of a journal went: read from what the controller accepted.

Shares no code with the layers that limit them.
"""

import math
import struct
from dataclasses import dataclass
from pathlib import Path

from genpolicy.verification.journal_source import read_messages
from genpolicy.verification.report import Point, Reached

COMMANDS = ("accept", "fallback")
POSITION = struct.Struct("<3d")
NS_PER_S = 1e9


@dataclass(frozen=True)
class Reach:
    """Commands of all sessions of a journal, of the policy and of the fallback.

    Attributes:
        commands: How many were accepted.
        fastest_m_s: Longest way from a command to the next one, over one period, m/s.
        lowest_m: Lowest x, y, z commanded, m; infinite without commands.
        highest_m: Highest.
    """

    commands: int
    fastest_m_s: float
    lowest_m: Point
    highest_m: Point

    def as_document(self) -> Reached:
        """For JSON; without commands there are no corners."""
        some = self.commands > 0
        return Reached(
            commands=self.commands,
            fastest_m_s=self.fastest_m_s if some else None,
            lowest_m=self.lowest_m if some else None,
            highest_m=self.highest_m if some else None,
        )


def reach_of(path: Path) -> Reach:
    """Read a journal.

    A session's first command is measured from nothing; every other one from the command before,
    as if one period lay between them, so that a hold in between slows nothing down.

    Raises:
        IntegrityError: No regular file.
        BadInputError: Not a whole journal, or a command that cannot be read.
    """
    count, fastest, period_s = 0, 0.0, math.nan
    last: dict[str, tuple[float, ...]] = {}
    low, high = [math.inf] * 3, [-math.inf] * 3
    for kind, message in read_messages(path):
        session = str(message.get("session"))
        if kind == "session":
            period_s = message["period_ns"] / NS_PER_S
        if kind not in COMMANDS:
            continue
        position = POSITION.unpack(bytes.fromhex(message["action"])[: POSITION.size])
        count += 1
        low = [min(pair) for pair in zip(low, position, strict=True)]
        high = [max(pair) for pair in zip(high, position, strict=True)]
        if session in last:
            fastest = max(fastest, math.dist(last[session], position) / period_s)
        last[session] = position
    return Reach(count, fastest, (low[0], low[1], low[2]), (high[0], high[1], high[2]))
