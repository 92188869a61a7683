"""What the comparison says beside its tables: power, envelope, teachers, trainings and blocks."""

from dataclasses import dataclass

from genpolicy.documents.document import Count, Document
from genpolicy.evidence.documents.given import Distilled
from genpolicy.statistics.eprocess import PowerRow
from genpolicy.verification.report import Point, Reached


@dataclass(frozen=True)
class Power:
    """Which verdicts the pre-registered test can reach.

    Attributes:
        margin: Margin of the test.
        alpha: Level of each candidate.
        pairs: Planned starts.
        rows: One per assumed world.
    """

    margin: float
    alpha: float
    pairs: Count
    rows: list[PowerRow]


@dataclass(frozen=True)
class Envelope:
    """What the rollouts inside the card's envelope were held to, and what they did.

    Attributes:
        condition: Name of the planned condition.
        workspace_lower_m: Lower corner, base frame, m.
        workspace_upper_m: Upper corner, m.
        speed_limit_m_s: Most for the speed of the TCP, m/s.
        reached: How far the commands of each method went.
    """

    condition: str
    workspace_lower_m: Point
    workspace_upper_m: Point
    speed_limit_m_s: float
    reached: dict[str, Reached]


@dataclass(frozen=True)
class Trainings:
    """Which trainings were rolled out beside those that may be promoted.

    Attributes:
        seeds: Numbers of their training seeds, in the order of `policy.seeds`.
    """

    seeds: list[Count]


@dataclass(frozen=True)
class Blocks:
    """How far each method was run where candidates that cannot pass any more are stopped.

    Attributes:
        block: Starts of a block.
        starts: Planned starts.
        last: Number of the last block of each method, from 1.
        out: Of each candidate that was stopped, the criterion that it cannot meet any more.
    """

    block: Count
    starts: Count
    last: dict[str, Count]
    out: dict[str, str]


POWER = Document("power.json", Power)
ENVELOPE = Document("envelope.json", Envelope)
"""Missing where no condition ran inside an envelope."""
DISTILLED = Document("distilled.json", dict[str, Distilled])
"""By method, of those that have a teacher; missing where none has."""
TRAININGS = Document("trainings.json", Trainings)
"""Missing where one training seed is planned; see `folder_of_seed`."""
BLOCKS = Document("blocks.json", Blocks)
"""Missing where all planned starts are one block."""


def folder_of_seed(seed: int) -> str:
    """Folder of what the comparison gave with a further training seed, below that of the first.

    Its tables and journals have the names and the form of those of the first seed.
    """
    return f"seeds/{seed}"
