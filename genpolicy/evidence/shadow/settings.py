"""Section `shadow`: how many held-out moments the shadow test looks at, and how."""

from pydantic import Field

from genpolicy.contract.settings import Settings


class ShadowSection(Settings):
    """Section `shadow`.

    Attributes:
        observations: Held-out observations, in equal numbers from every phase.
        samples: Candidates per observation.
        late_rows: Actions that are late when a chunk arrives.
        mutant_observations: Observations on which each check is left out once.
    """

    observations: int = Field(ge=1)
    samples: int = Field(ge=2)
    late_rows: int = Field(ge=0)
    mutant_observations: int = Field(ge=1)
