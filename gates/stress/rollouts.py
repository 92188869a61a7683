"""Rollouts of the matched comparison, and the settings of Gate D that say which must be there."""

from collections.abc import Mapping, Sequence
from typing import ClassVar

import pandas as pd
from pydantic import Field, field_validator

from gates.bounds import share_interval
from gates.criterion import Measured
from gates.evidence import Evidence, MissingEvidenceError, flags
from gates.settings import CandidateSettings
from genpolicy.evidence.rows.stress import RolloutRow

STRESS = "artifacts/stress"
ROLLOUTS = f"{STRESS}/rollouts.parquet"
NOMINAL = "nominal"


class StressSettings(CandidateSettings):
    """Settings of Gate D other than limits; all are fixed before the run.

    Attributes:
        baselines: Simpler methods; a candidate must beat each of them.
        perturbations: Conditions that every method must have met; `nominal` is one.
        margin: Gain in success share to be shown.
        family_alpha: Probability of any wrong promotion.
        planned_starts: Starts planned; fewer recorded ones leave the gate without a verdict.
        minimum_power: Share of simulated trials in which each verdict must be reached.
    """

    homes: ClassVar[Mapping[str, str]] = {
        **CandidateSettings.homes,
        "baselines": "stress.baselines",
        "perturbations": "stress.perturbations",
        "margin": "stress.margin",
        "family_alpha": "stress.alpha",
        "planned_starts": "stress.starts",
    }

    candidates: tuple[str, ...] = Field(min_length=1)
    baselines: tuple[str, ...]
    perturbations: tuple[str, ...]
    margin: float = Field(gt=-1.0, lt=1.0)
    family_alpha: float = Field(gt=0.0, lt=1.0)
    planned_starts: int = Field(gt=0)
    minimum_power: float = Field(gt=0.0, le=1.0)

    @property
    def alpha(self) -> float:
        """Probability of a wrong promotion of one candidate (Bonferroni over the candidates)."""
        return self.family_alpha / len(self.candidates)

    @field_validator("perturbations")
    @classmethod
    def _undisturbed_and_more(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        if NOMINAL not in names or len(names) < 2:
            raise ValueError(f"{NOMINAL} and at least one more condition are needed")
        return names


def rollouts(evidence: Evidence, settings: StressSettings, method: str) -> pd.DataFrame:
    """Rollouts of a method under the planned conditions.

    Raises:
        MissingEvidenceError: A condition is missing, or has fewer starts than planned.
    """
    rows = evidence.of(ROLLOUTS, RolloutRow, method)
    rows = rows[rows["perturbation"].isin(settings.perturbations)]
    absent = sorted(set(settings.perturbations) - set(rows["perturbation"]))
    if absent:
        raise MissingEvidenceError(f"{method} did not meet {', '.join(absent)}")
    per_condition = rows.groupby("perturbation")["start"].nunique()
    if int(per_condition.min()) < settings.planned_starts:
        raise MissingEvidenceError(
            f"{method} has {int(per_condition.min())} starts in {per_condition.idxmin()}, "
            f"planned {settings.planned_starts}"
        )
    return rows


def success_lower(
    evidence: Evidence, settings: StressSettings, candidate: str, conditions: Sequence[str]
) -> Measured:
    """Lowest lower bound of success over some conditions; the starts are independent.

    Raises:
        MissingEvidenceError: As `rollouts`, or a rollout without outcome.
    """
    rows = rollouts(evidence, settings, candidate)
    if rows["success"].isna().any():
        raise MissingEvidenceError("a rollout has no outcome")
    found = []
    for condition in conditions:
        part = rows[rows["perturbation"] == condition]
        share, lower, upper = share_interval(
            flags(part, "success"),
            part["start"].to_numpy(),
            confidence=settings.confidence,
            favourable=True,
        )
        found.append((lower, upper, share, condition, part["start"].nunique()))
    lower, upper, share, condition, starts = min(found)
    text = f"{condition}: share {share:.4g}, lower bound over {starts} starts"
    return Measured(lower, (lower, upper), text)
