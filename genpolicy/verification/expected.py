"""What a journal is held to: settings as the caller knows them, whatever it declares."""

from dataclasses import dataclass
from typing import Any

ALWAYS = {"version": 12, "fallback_hash": "classical-fallback"}
"""What every session declares: the journal that is read here, since in another one the same words
may mean something else, and who makes the fallback's chunks, since nobody else commands as such."""


@dataclass(frozen=True)
class ExpectedSettings:
    """What the caller knows that the sessions must have been held to; times in s.

    Attributes:
        execution_horizon: Actions of a chunk that may be executed.
        action_period_s: Time between actions.
        maximum_age_s: Largest action age, by phase.
        watchdog_s: Silence after which there must be a hold.
        queue_capacity: Chunks that may wait.
        controller_mode: The one mode in which an action may be accepted.
        replan_lead_rows: A chunk that begins behind this row is late.
        late_chunk: `continue`, `hold` or `fallback`, by phase; only where a phase says `continue`
            may a late chunk be executed.
        force_limit_n: Force at which the supervisor stops, by phase. A journal does not declare
            it; above the one of the phase in which it was measured nothing may be accepted.
        maximum_divergence_m: Distance of measured from commanded TCP beyond which what was made
            before is void.
        maximum_scene_shift_m: How far a body may be seen from where it stood when a chunk was
            checked; beyond it nothing of the chunk may be accepted.
        deadline_s: An invocation that has not answered so long after the exposure of what it saw
            is given up at the next tick. A journal does not declare it.
        silence_stop_s: Silence after which the supervisor stops; None: it holds, however long. A
            journal does not declare it.
    """

    execution_horizon: int
    action_period_s: float
    maximum_age_s: dict[str, float]
    watchdog_s: float
    queue_capacity: int
    controller_mode: str
    replan_lead_rows: int
    late_chunk: dict[str, str]
    force_limit_n: dict[str, float]
    maximum_divergence_m: float
    maximum_scene_shift_m: float
    deadline_s: float
    silence_stop_s: float | None = None

    def declared(self) -> dict[str, Any]:
        """The same in the journal's words."""
        return {
            "execution_horizon": self.execution_horizon,
            "period_ns": round(self.action_period_s * 1e9),
            "maximum_age_ns": {k: round(v * 1e9) for k, v in self.maximum_age_s.items()},
            "watchdog_ns": round(self.watchdog_s * 1e9),
            "queue_capacity": self.queue_capacity,
            "controller_mode": self.controller_mode,
            "replan_lead_rows": self.replan_lead_rows,
            "late_chunk": self.late_chunk,
            "maximum_divergence_m": self.maximum_divergence_m,
            "maximum_scene_shift_m": self.maximum_scene_shift_m,
        }
