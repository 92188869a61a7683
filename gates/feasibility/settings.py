"""What Gate C is set by other than limits, and where its evidence lies."""

from pydantic import Field

from gates.again import CHANGED
from gates.asked_for import CHECKS_ASKED_FOR
from gates.settings import CandidateSettings

SHADOW = "artifacts/shadow"
JOURNALS = f"{SHADOW}/*.mcap"
CANDIDATES = f"{SHADOW}/candidates.parquet"
LAYERS = ("representation", "kinematic", "geometric", "dynamic", "contact", "fresh")
REASONS = tuple(
    name for layer, _, name in (row.partition(".") for row in CHECKS_ASKED_FOR) if layer in LAYERS
)
"""Why a layer may reject: the checks of the six layers, and nothing else."""
PASSED, FAILED, UNKNOWN, NOT_REACHED = "passed", "failed", "unknown", "not_reached"
"""What came of a layer, and but for the last of a candidate: a check that could not be evaluated
is unknown, and a layer behind one that rejected was not reached."""
HELD_OUT = "held_out"
TWO_MODES = "two_modes"
INTACT = (HELD_OUT, TWO_MODES)
NO_MODE = ("", "none", "unassigned")
"""What a candidate is labelled that belongs to no mode: unknown, no path, between the modes."""


class FeasibilitySettings(CandidateSettings):
    """Settings of Gate C other than limits.

    Attributes:
        required_fixtures: Corrupted fixtures that must have been tried.
        mode_observations: Independent observations of every mode without which the modes are not
            compared.
    """

    required_fixtures: tuple[str, ...]
    mode_observations: int = Field(ge=2)

    def excepted(self, criterion: str, candidate: str | None) -> bool:
        """Whether a criterion is asked of those that were brought only, and this one was not."""
        return criterion == CHANGED and candidate not in self.brought
