"""Section `latency`, read by the stage that measures and by the one that draws from it."""

from pydantic import Field

from genpolicy.contract.settings import Settings
from genpolicy.evidence.reproducibility.latency import DeclaredSettings


class LatencySection(Settings):
    """Section `latency`.

    Attributes:
        warm: Warm invocations per run.
        cold: Cold invocations per run.
        declared: Bounds of the terms that this machine cannot measure.
        declared_draws: Values drawn from each of them for the report.
    """

    warm: int = Field(ge=20)
    cold: int = Field(ge=2)
    declared: dict[str, DeclaredSettings]
    declared_draws: int = Field(ge=20)
