"""Which conditions are searched, and how hard each may get: from nothing to what is stated."""

from collections.abc import Mapping
from dataclasses import dataclass

from genpolicy.evidence.failure_search.settings import LEAST_SHARE
from genpolicy.evidence.rows.stress import NEUTRAL
from genpolicy.evidence.stress.perturbations import ByLot, Perturbation, SidewaysPush
from genpolicy.evidence.stress.settings import Grades, StressSettings

SEARCHED = "@search"
"""Behind the name of a condition: its draws are streams of their own, and none that judges."""
OPEN, CONTACT = "force_n", "contact_force_n"
"""Both forces of a push are made weaker together: without one of them it is another condition."""


@dataclass(frozen=True)
class Condition:
    """A planned condition that is searched.

    Attributes:
        of: Its name in `stress.perturbations`.
        planned: As it is judged.
        field: Which of its fields is varied; empty where it has no size, and starts alone are.
        most: Largest size that is stated, judged or graded.
    """

    of: str
    planned: Perturbation
    field: str = ""
    most: float = 0.0

    @property
    def name(self) -> str:
        """Name under which it is run."""
        return f"{self.of}{SEARCHED}"

    @property
    def sizes(self) -> int:
        """Coordinates of its size: one or none."""
        return int(bool(self.field))

    def severity(self, unit: float) -> float:
        """The size at a number in [0, 1]: above nothing, and at most the largest stated."""
        nothing = NEUTRAL[self.field]
        share = LEAST_SHARE + (1.0 - LEAST_SHARE) * unit
        return nothing + share * (self.most - nothing)

    def share(self, severity: float | None) -> float:
        """How far a size is from nothing to the largest; 1 where there is none."""
        if severity is None:
            return 1.0
        nothing = NEUTRAL[self.field]
        return (severity - nothing) / (self.most - nothing)

    def at(self, severity: float | None) -> Perturbation:
        """The condition at a size; as planned where it has none."""
        if severity is None:
            return self.planned
        changes = {self.field: severity}
        if isinstance(self.planned, SidewaysPush):
            changes[CONTACT] = self.planned.contact_force_n * severity / self.planned.force_n
        return self.planned.model_validate({**self.planned.model_dump(), **changes})


def searched_conditions(settings: StressSettings) -> list[Condition]:
    """Every judged condition, in the order of the plan."""
    return [
        _condition(name, planned, settings.severities)
        for name, planned in settings.perturbations.items()
    ]


def _condition(name: str, planned: Perturbation, severities: Mapping[str, Grades]) -> Condition:
    if isinstance(planned, SidewaysPush):
        field = OPEN
    elif isinstance(planned, ByLot):
        field = severities[name].field if name in severities else planned.graded[0]
    else:
        return Condition(name, planned)
    stated = severities[name].values if name in severities else []
    return Condition(name, planned, field, max([getattr(planned, field), *stated]))
