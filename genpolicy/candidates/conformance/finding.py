"""What a finding is: one thing that was looked at holds, fails, or is not known."""

from dataclasses import dataclass
from typing import Literal

Judged = Literal["holds", "fails", "unknown"]


@dataclass(frozen=True)
class Finding:
    """One thing that was looked at.

    Attributes:
        name: Its name.
        judged: Whether it holds.
        gate: Letter of the gate that asks for it.
        said: What was seen.
    """

    name: str
    judged: Judged
    gate: str
    said: str
