"""What a finding is: one thing that was looked at holds, fails, or is not known."""

from dataclasses import dataclass
from typing import Literal

Judged = Literal["holds", "fails", "unknown"]
PLAUSIBLE = ("follows_observation", "scale", "origin", "orientation", "own_answers")
"""What its numbers say."""
OF_ANSWERS = ("answers", "repeats", "restarts", "seeded", "evaluations", *PLAUSIBLE)
"""What answers alone say, whatever the clock: Gate B asks for each."""
ONE_IN_TWO = 0.5
"""A share of moments is held against most of them, at the worse end of its interval."""


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
