"""Section `execution`: how executor, supervisor and recovery of the simulated cell are set."""

from collections.abc import Iterable
from typing import Any

from pydantic import model_validator

from genpolicy.contract.horizons import HorizonConfig
from genpolicy.contract.settings import Settings
from genpolicy.errors import ConfigError
from genpolicy.execution.recovery import RecoverySettings, RecoveryState
from genpolicy.execution.settings import ExecutorSettings
from genpolicy.execution.supervisor import SupervisorSettings

DEFAULT = "default"
"""Key of a table by phase whose value holds for every phase that the table does not name."""


class ExecutionSettings(Settings):
    """Section `execution`: fixtures of the executor and the supervisor, equal for all methods.

    The phases are those of `force_limit_n`, which has no default: each names its own limit.
    `maximum_age_s` and `recovery_plans` may name a `default` and the phases that differ from it,
    and an age may be one number; what is read back is complete, one entry per phase.

    Attributes:
        replan_lead_steps: Executable actions left at which the next invocation begins.
        deadline_s: An invocation that takes longer has missed its deadline and is given up.
        watchdog_s: Silence after which the stub holds.
        queue_capacity: Chunks kept.
        maximum_age_s: Largest action age by phase, less than a chunk's validity (execution
            horizon times period), or it would refuse nothing; one number for all.
        maximum_divergence_m: Measured against commanded TCP, beyond which chunks are void.
        force_limit_n: Contact force by phase at which the simulated supervisor stops. A fixture
            of the simulation, not a value for any robot.
        hold_before_recovery_s: Silence after which recovery begins.
        recovery_hold_s: Hold at the start of a recovery.
        primitive_timeout_s: Longest fallback primitive.
        human_timeout_s: How long recovery waits for a person.
        maximum_failures: Failed primitives before it aborts.
        recovery_plans: Primitives by phase.
    """

    replan_lead_steps: int
    deadline_s: float
    watchdog_s: float
    queue_capacity: int
    maximum_age_s: dict[str, float]
    maximum_divergence_m: float
    force_limit_n: dict[str, float]
    hold_before_recovery_s: float
    recovery_hold_s: float
    primitive_timeout_s: float
    human_timeout_s: float
    maximum_failures: int
    recovery_plans: dict[str, list[str]]

    @model_validator(mode="before")
    @classmethod
    def _by_phase(cls, values: Any) -> Any:
        if not isinstance(values, dict) or not isinstance(values.get("force_limit_n"), dict):
            return values
        phases = list(values["force_limit_n"])
        complete = dict(values)
        for name in ("maximum_age_s", "recovery_plans"):
            table = complete.get(name)
            if name == "maximum_age_s" and not isinstance(table, dict):
                table = {DEFAULT: table}
            if isinstance(table, dict):
                complete[name] = _complete(name, table, phases)
        return complete

    def require_phases(self, phases: Iterable[str]) -> None:
        """Refuse a section whose phases are not the task's.

        Raises:
            ConfigError: A phase has no limits, or limits are for a phase that does not exist.
        """
        if set(phases) != set(self.force_limit_n):
            raise ConfigError(
                where="execution.force_limit_n",
                found=f"phases {sorted(self.force_limit_n)}",
                expected=f"the task's: {sorted(phases)}",
                action="Name a force limit for each phase of the task and for no other.",
            )

    def executor(self, horizons: HorizonConfig) -> ExecutorSettings:
        """Settings of the executor and its stub.

        Raises:
            ConfigError: An age limit that no chunk can reach: it is void before.
        """
        self._require_ages_that_bind(horizons)
        return ExecutorSettings(
            execution_horizon=horizons.execution_horizon,
            action_period_s=horizons.action_period_s,
            maximum_age_s=self.maximum_age_s,
            watchdog_s=self.watchdog_s,
            queue_capacity=self.queue_capacity,
            replan_lead_steps=self.replan_lead_steps,
            maximum_divergence_m=self.maximum_divergence_m,
        )

    def _require_ages_that_bind(self, horizons: HorizonConfig) -> None:
        valid_s = horizons.execution_horizon * horizons.action_period_s
        for phase, age_s in self.maximum_age_s.items():
            if not age_s < valid_s - 1e-9:
                raise ConfigError(
                    where=f"execution.maximum_age_s of phase {phase}",
                    found=f"{age_s} s",
                    expected=f"less than {valid_s:g} s, after which a chunk is no longer valid",
                    action="Lower it: a limit that nothing can reach refuses nothing.",
                )

    def supervisor(self, horizons: HorizonConfig) -> SupervisorSettings:
        """Settings of the simulated supervisor."""
        return SupervisorSettings(
            force_limit_n=self.force_limit_n,
            watchdog_s=self.watchdog_s,
            action_period_s=horizons.action_period_s,
        )

    def recovery(self) -> RecoverySettings:
        """Settings of the recovery state machine."""
        plans = {
            phase: tuple(RecoveryState(name) for name in names)
            for phase, names in self.recovery_plans.items()
        }
        return RecoverySettings(
            plans=plans,
            hold_s=self.recovery_hold_s,
            primitive_timeout_s=self.primitive_timeout_s,
            human_timeout_s=self.human_timeout_s,
            maximum_failures=self.maximum_failures,
            maximum_attempts=self.maximum_failures,
        )


def _complete(name: str, table: dict[str, Any], phases: list[str]) -> dict[str, Any]:
    """One entry per phase, from the phase's own or the default; a phase without either has none."""
    for phase in table:
        if phase != DEFAULT and phase not in phases:
            raise ConfigError(
                where=f"execution.{name}",
                found=f"the phase {phase!r}",
                expected=f"one of {phases} or {DEFAULT!r}",
                action="Name a phase that has a force limit.",
            )
    return {
        phase: table[phase] if phase in table else table[DEFAULT]
        for phase in phases
        if phase in table or DEFAULT in table
    }
