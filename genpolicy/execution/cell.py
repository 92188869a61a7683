"""Section `execution`: how executor, supervisor and recovery of the simulated cell are set."""

from genpolicy.contract.horizons import HorizonConfig
from genpolicy.contract.settings import Settings
from genpolicy.execution.recovery import RecoverySettings, RecoveryState
from genpolicy.execution.settings import ExecutorSettings
from genpolicy.execution.supervisor import SupervisorSettings


class ExecutionSettings(Settings):
    """Section `execution`: fixtures of the executor and the supervisor, equal for all methods.

    Attributes:
        replan_lead_steps: Executable actions left at which the next invocation begins.
        deadline_s: An invocation that takes longer has missed its deadline and is given up.
        watchdog_s: Silence after which the stub holds.
        queue_capacity: Chunks kept.
        maximum_age_s: Largest action age by phase.
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

    def executor(self, horizons: HorizonConfig) -> ExecutorSettings:
        """Settings of the executor and its stub."""
        return ExecutorSettings(
            execution_horizon=horizons.execution_horizon,
            action_period_s=horizons.action_period_s,
            maximum_age_s=self.maximum_age_s,
            watchdog_s=self.watchdog_s,
            queue_capacity=self.queue_capacity,
            replan_lead_steps=self.replan_lead_steps,
            maximum_divergence_m=self.maximum_divergence_m,
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
