"""Settings of the executor; times in s, in whole ns for those who compare."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from genpolicy.errors import ConfigError
from genpolicy.execution.moment import View
from genpolicy.execution.nanoseconds import to_ns


@dataclass(frozen=True)
class ExecutorSettings:
    """What the executor is held to; times in s, converted to ns once.

    Attributes:
        execution_horizon: Actions of a chunk that may be executed, H_e >= 1.
        action_period_s: Time between actions, > 0.
        maximum_age_s: Largest action age per task phase; a phase without one accepts nothing.
        watchdog_s: Silence after which the stub holds by itself; at least one period.
        queue_capacity: Chunks kept; the oldest is dropped beyond it.
        replan_lead_steps: Executable actions left at which the next invocation begins.
        maximum_divergence_m: Largest distance of measured from commanded TCP position.
        fallback_hash: Identity of the task's fallback planner, in place of a checkpoint.
    """

    execution_horizon: int
    action_period_s: float
    maximum_age_s: Mapping[str, float]
    watchdog_s: float
    queue_capacity: int
    replan_lead_steps: int
    maximum_divergence_m: float = math.inf
    fallback_hash: str = "classical-fallback"

    def __post_init__(self) -> None:
        object.__setattr__(self, "maximum_age_s", dict(self.maximum_age_s))
        rules = {
            "execution_horizon": self.execution_horizon >= 1,
            "action_period_s": self.action_period_s > 0 and math.isfinite(self.action_period_s),
            "watchdog_s": self.watchdog_s >= self.action_period_s
            and math.isfinite(self.watchdog_s),
            "queue_capacity": self.queue_capacity >= 1,
            "replan_lead_steps": self.replan_lead_steps >= 0,
            "maximum_age_s": all(v >= 0 and math.isfinite(v) for v in self.maximum_age_s.values()),
            "maximum_divergence_m": self.maximum_divergence_m >= 0,
            "fallback_hash": bool(self.fallback_hash),
        }
        for name, holds in rules.items():
            if not holds:
                raise ConfigError(
                    where=f"executor setting {name}",
                    found=repr(getattr(self, name)),
                    expected="finite and in its range (period > 0, watchdog >= period)",
                    action="Correct it in params.yaml.",
                )

    @cached_property
    def period_ns(self) -> int:
        """Time between actions, ns."""
        return to_ns(self.action_period_s)

    @property
    def watchdog_ns(self) -> int:
        """Silence after which the stub holds, ns."""
        return to_ns(self.watchdog_s)

    @cached_property
    def maximum_age_ns(self) -> dict[str, int]:
        """Largest action age per phase, ns."""
        return {phase: to_ns(age) for phase, age in self.maximum_age_s.items()}

    def first_view(self) -> View:
        """The view of whoever is held to these settings, before anything is observed."""
        return View(
            fallback=self.fallback_hash,
            execution_horizon=self.execution_horizon,
            period_ns=self.period_ns,
        )
