"""Section `latency`, read by the stage that measures and by the one that draws from it."""

from typing import Annotated

from pydantic import Field

from genpolicy.contract.settings import Settings
from genpolicy.evidence.stress.latency import DeclaredTerm


class LatencySection(Settings):
    """Section `latency`.

    Attributes:
        warm: Warm invocations of each process.
        cold: Cold invocations of each process.
        declared: Least and most of each term that this machine cannot measure, s.
    """

    warm: int = Field(ge=20)
    cold: int = Field(ge=2)
    declared: dict[str, Annotated[list[float], Field(min_length=2, max_length=2)]]

    @property
    def declared_terms(self) -> dict[str, DeclaredTerm]:
        """Bounds of the terms that this machine cannot measure."""
        return {name: DeclaredTerm(bounds[0], bounds[1]) for name, bounds in self.declared.items()}
