"""Section `stress`: the matched comparison, registered before it runs."""

from typing import Annotated, Any

from pydantic import Field, field_validator, model_validator

from genpolicy.candidates.joining import JoiningSettings
from genpolicy.contract.settings import Settings
from genpolicy.evidence.stress.person import PersonSettings
from genpolicy.evidence.stress.perturbations import Perturbation, ReducedEnvelope

ENVELOPE = "envelope"
"""Name of the condition that runs inside the trial card's envelope, and its kind."""
Share = Annotated[float, Field(ge=0.0, le=1.0)]


class StressSettings(Settings):
    """Section `stress`.

    Attributes:
        starts: Initial states, equal for all methods.
        episode_limit_s: Longest rollout.
        samples: Candidates per invocation of a stochastic method.
        baselines: Simpler methods in the comparison, timed and run beside the candidates.
        perturbations: What is injected, by name; `nominal` is one of them. One that names no kind
            is of the kind of its name.
        margin: Pre-registered gain in success.
        alpha: Pre-registered family-wise error; each candidate gets its equal share.
        planned_effect: Success of a baseline and of a candidate that is worth promoting; a gain
            of this size must be found.
        joining: How a chunk joins the plan that it takes over from, by one rule for all methods.
        person: Who comes when recovery calls a person; null: nobody, and the call ends a rollout.
    """

    starts: int = Field(ge=1)
    episode_limit_s: float = Field(gt=0)
    samples: int = Field(ge=1)
    baselines: list[str]
    perturbations: dict[str, Perturbation]
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
    def _effect_beyond_margin(self) -> "StressSettings":
        baseline, candidate = self.planned_effect
        if not candidate - baseline > self.margin:
            raise ValueError("the planned effect must be larger than the margin")
        return self

    def alpha_of_each(self, candidates: int) -> float:
        """Error that one of so many pre-registered candidates may spend (Bonferroni)."""
        return self.alpha / candidates
