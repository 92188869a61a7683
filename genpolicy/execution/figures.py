"""The figures of a cell that the independent checker holds sessions against."""

from genpolicy.execution.cell import Cell
from genpolicy.verification.expected import ExpectedSettings


def expected_settings(cell: Cell) -> ExpectedSettings:
    """What every session of this cell must have been held to, whatever its journal says.

    Args:
        cell: From `params.yaml`, never from the journal.
    """
    horizons, execution = cell.horizons, cell.execution
    return ExpectedSettings(
        execution_horizon=horizons.execution_horizon,
        action_period_s=horizons.action_period_s,
        maximum_age_s=execution.maximum_age_s,
        watchdog_s=execution.watchdog_s,
        queue_capacity=execution.queue_capacity,
        controller_mode=cell.controller_mode,
        replan_lead_rows=execution.replan_lead_rows,
        late_chunk=execution.late_by_phase,
        force_limit_n=execution.force_limit_n,
        maximum_divergence_m=execution.maximum_divergence_m,
        maximum_scene_shift_m=execution.maximum_scene_shift_m,
        deadline_s=execution.deadline_s,
        silence_stop_s=execution.silence_stop_s,
    )
