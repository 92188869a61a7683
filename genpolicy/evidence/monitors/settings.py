"""Section `monitors`: which probes are run, and what the monitors are asked."""

import math
from typing import Annotated, Literal

from pydantic import Field, field_validator, model_validator

from genpolicy.contract.settings import Settings
from genpolicy.monitors.names import CONTROLS, KINDS

WHERE = "params.yaml: monitors"
SEPARATOR = "@"
"""Between a family of probes and its severity, in the name of a condition."""
THRESHOLDS, JUDGED = "thresholds", "judged"
"""Conditions without a probe: whose episodes set thresholds, and whose count false alarms."""
NOMINAL = "nominal"
"""What the second of them is called among the families."""


class ProbeFamily(Settings):
    """One way to leave the distribution, graded.

    Attributes:
        severities: Factors on the probe of the task, ascending; 1 is as the task defines it.
        felt: From when on: from the `start`, or from the first invocation in `contact`.
    """

    severities: list[Annotated[float, Field(gt=0.0, lt=math.inf)]] = Field(min_length=1)
    felt: Literal["start", "contact"] = "start"

    @field_validator("severities")
    @classmethod
    def _ascending(cls, values: list[float]) -> list[float]:
        if values != sorted(set(values)):
            raise ValueError("severities must ascend")
        return values


class MonitorsSettings(Settings):
    """Section `monitors`; without monitors or without probes nothing is run.

    Attributes:
        kinds: Monitors beside the two controls, by name.
        alpha: Chance of an alarm in a phase of a successful nominal episode, at most.
        threshold_starts: Nominal episodes whose successes set the thresholds.
        judged_starts: Other nominal episodes, whose successes count false alarms.
        probe_starts: Episodes of each family and severity.
        probes: Families, by the name that the task gives a probe.
    """

    kinds: list[str] = Field(default_factory=list)
    alpha: float = Field(default=0.1, gt=0.0, lt=1.0)
    threshold_starts: int = Field(default=0, ge=0)
    judged_starts: int = Field(default=0, ge=0)
    probe_starts: int = Field(default=0, ge=0)
    probes: dict[str, ProbeFamily] = Field(default_factory=dict)

    @field_validator("kinds")
    @classmethod
    def _known(cls, names: list[str]) -> list[str]:
        for name in names:
            if name not in KINDS:
                raise ValueError(f"{name!r} is no monitor; there are {', '.join(KINDS)}")
        return names

    @model_validator(mode="after")
    def _all_or_nothing(self) -> "MonitorsSettings":
        counts = (self.threshold_starts, self.judged_starts, self.probe_starts)
        if self.on and not min(counts) >= 1:
            raise ValueError("probes need starts for thresholds, for false alarms and of their own")
        return self

    @property
    def on(self) -> bool:
        """Whether anything is run."""
        return bool(self.kinds and self.probes)

    @property
    def rollouts(self) -> int:
        """Rollouts of each method that is watched."""
        if not self.on:
            return 0
        probed = len(self.conditions) * self.probe_starts
        return self.threshold_starts + self.judged_starts + probed

    @property
    def watching(self) -> tuple[str, ...]:
        """Monitors that are asked, the controls last."""
        return (*self.kinds, *CONTROLS)

    @property
    def conditions(self) -> tuple[str, ...]:
        """Names of the conditions with a probe, families in order."""
        return tuple(
            condition_of(name, severity)
            for name, family in self.probes.items()
            for severity in family.severities
        )


def condition_of(family: str, severity: float) -> str:
    """Name of a condition: as the task reads it in `WorldSettings.probe`."""
    return f"{family}{SEPARATOR}{severity:g}"


def family_of(condition: str) -> tuple[str, float]:
    """Family and severity of a condition; `nominal` and 0 of those without a probe."""
    name, separator, severity = condition.partition(SEPARATOR)
    return (name, float(severity)) if separator else (NOMINAL, 0.0)
