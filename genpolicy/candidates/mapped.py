"""Are the observations, joints and frames that entries name those of the task? Asked before all."""

from collections.abc import Iterable

from genpolicy.candidates.brought import BroughtPolicy
from genpolicy.candidates.wire.mapping import Inputs, Outputs
from genpolicy.tasks.api import Task


def require_mapped(brought: Iterable[BroughtPolicy], task: Task) -> None:
    """Refuse an entry whose inputs or actions cannot be mapped; nothing is started.

    Args:
        brought: Who was brought.
        task: The task, with its observation and its robot.

    Raises:
        ContractError: An entry names what the observation or the robot does not have.
    """
    for policy in brought:
        entry = policy.entry
        horizon = entry.horizons.observation_horizon
        Inputs(entry.observation, task.observation, observation_horizon=horizon)
        Outputs(entry.action, task.observation, scene=task.scene_path)
