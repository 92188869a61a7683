"""Section `stress`: the matched comparison, registered before it runs."""

from itertools import pairwise
from typing import Annotated, Any, Self

from pydantic import Field, field_validator, model_validator

from genpolicy.candidates.joining import JoiningSettings
from genpolicy.contract.settings import Settings
from genpolicy.evidence.rows.stress import SeverityRow
from genpolicy.evidence.stress.perturbations import Perturbation, ReducedEnvelope, gradable

GRADED = "@"
"""Between a condition and a size of it that is run for a curve, in the name of that."""
ENVELOPE = "envelope"
"""Name of the condition that runs inside the trial card's envelope, and its kind."""
OF_THEIR_NAME = ("nominal", "recovery_drill")
"""Gate D asks other things of the conditions of these names, so each is of that kind. Of the kind
there may be more; they are asked as all others are."""
Share = Annotated[float, Field(ge=0.0, le=1.0)]
Seconds = Annotated[float, Field(ge=0.0)]


class Grades(Settings):
    """How hard a condition is made, apart from what is judged.

    Attributes:
        field: Which of its fields.
        values: Sizes of it, rising, the judged one among them.
    """

    field: str
    values: list[float] = Field(min_length=2)

    @field_validator("values")
    @classmethod
    def _rising(cls, values: list[float]) -> list[float]:
        if not all(low < high for low, high in pairwise(values)):
            raise ValueError("the sizes must rise")
        return values


class PersonSettings(Settings):
    """Section `stress.person`.

    Attributes:
        reaction_s: Least and most time from the call until it has the arm, s; drawn uniformly,
            for each call of a start alike for all methods.
        longest_s: How long it may have the arm in one rollout, s; then it gives up.
    """

    reaction_s: tuple[Seconds, Seconds]
    longest_s: float = Field(gt=0.0)

    @field_validator("reaction_s", mode="before")
    @classmethod
    def _pair(cls, value: object) -> object:
        return tuple(value) if isinstance(value, list) else value

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if not self.reaction_s[1] >= self.reaction_s[0]:
            raise ValueError("the least reaction time comes first")
        return self


class StressSettings(Settings):
    """Section `stress`.

    Attributes:
        starts: Initial states, equal for all methods.
        block: Starts after which it is asked who can no longer pass, and runs no further; null, or
            not below `starts`: nobody is asked, and all run all.
        episode_limit_s: Longest rollout.
        samples: Candidates per invocation of a stochastic method.
        baselines: Simpler methods in the comparison, timed and run beside the candidates.
        perturbations: What is injected, by name; `nominal` is one of them. One that names no kind
            is of the kind of its name.
        severities: Conditions of which success is shown against how hard they are, by name. What is
            judged stays the condition as it is planned; the others are run beside it.
        margin: Pre-registered gain in success.
        alpha: Pre-registered family-wise error; each candidate gets its equal share.
        planned_effect: Success of a baseline and of a candidate that is worth promoting; a gain
            of this size must be found.
        joining: How a chunk joins the plan that it takes over from, by one rule for all methods.
        person: Who comes when recovery calls a person; null: nobody, and the call ends a rollout.
    """

    starts: int = Field(ge=1)
    block: int | None = Field(default=None, ge=1)
    episode_limit_s: float = Field(gt=0)
    samples: int = Field(ge=1)
    baselines: list[str]
    perturbations: dict[str, Perturbation]
    severities: dict[str, Grades] = Field(default_factory=dict)
    margin: float
    alpha: float = Field(gt=0.0, lt=1.0)
    planned_effect: tuple[Share, Share]
    joining: JoiningSettings = Field(default_factory=JoiningSettings)
    person: PersonSettings | None = None

    @field_validator("planned_effect", mode="before")
    @classmethod
    def _pair(cls, value: object) -> object:
        return tuple(value) if isinstance(value, list) else value

    @field_validator("perturbations", mode="before")
    @classmethod
    def _kind_by_name(cls, value: Any) -> Any:
        if not isinstance(value, dict):
            return value
        return {
            name: {"kind": name, **entry} if isinstance(entry, dict) else entry
            for name, entry in value.items()
        }

    @model_validator(mode="after")
    def _one_envelope(self) -> "StressSettings":
        for name, condition in self.perturbations.items():
            if isinstance(condition, ReducedEnvelope) != (name == ENVELOPE):
                raise ValueError(f"`{ENVELOPE}` is the name of the one condition of that kind")
        return self

    @model_validator(mode="after")
    def _what_their_name_says(self) -> Self:
        for name in OF_THEIR_NAME:
            condition = self.perturbations.get(name)
            if condition is not None and condition.kind != name:
                raise ValueError(f"`{name}` is the name of a condition of that kind alone")
        return self

    @model_validator(mode="after")
    def _grades_of_what_is_planned(self) -> "StressSettings":
        for name, grades in self.severities.items():
            planned = self.perturbations.get(name)
            if grades.field not in gradable(planned):
                raise ValueError(
                    f"`{name}.{grades.field}` is no size of a planned condition that can be graded"
                )
            own = getattr(planned, grades.field)
            if own not in grades.values:
                raise ValueError(f"the judged size {own:g} of `{name}` is not among the sizes")
        names = [*self.perturbations]
        names += [row.perturbation for row in self.severity_rows if row.perturbation != row.of]
        if len(set(names)) < len(names):
            raise ValueError("the names of conditions and their sizes must be unique")
        self._graded()  # a size that its kind refuses is refused here
        return self

    @model_validator(mode="after")
    def _effect_beyond_margin(self) -> "StressSettings":
        baseline, candidate = self.planned_effect
        if not candidate - baseline > self.margin:
            raise ValueError("the planned effect must be larger than the margin")
        return self

    @property
    def severity_rows(self) -> list[SeverityRow]:
        """Every size of every curve, and the name under which it is run; that judged keeps its own.

        The names are unique: a condition and a size behind `@`.
        """
        return [
            SeverityRow(
                perturbation=name if size == own else f"{name}{GRADED}{size:g}",
                of=name,
                field=grades.field,
                severity=size,
            )
            for name, grades in self.severities.items()
            for own in [getattr(self.perturbations[name], grades.field)]
            for size in grades.values
        ]

    @property
    def conditions(self) -> dict[str, Perturbation]:
        """All that is run, by name: what is judged, and what is harder or milder than it."""
        return {**self.perturbations, **self._graded()}

    def _graded(self) -> dict[str, Perturbation]:
        return {
            row.perturbation: planned.model_validate(
                {**planned.model_dump(), row.field: row.severity}
            )
            for row in self.severity_rows
            if row.perturbation != row.of
            for planned in [self.perturbations[row.of]]
        }

    def alpha_of_each(self, candidates: int) -> float:
        """Error that one of so many pre-registered candidates may spend (Bonferroni)."""
        return self.alpha / candidates
