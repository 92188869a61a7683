"""Are the observations, joints and frames that entries name those of the task? Asked before all."""

from collections.abc import Iterable
from pathlib import Path

from genpolicy.candidates.brought import BroughtPolicy
from genpolicy.candidates.wire.entry import Entry
from genpolicy.candidates.wire.mapping import Inputs, Outputs
from genpolicy.contract.observation import ObservationContract
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
        require_map(policy.entry, task.observation, task.scene_path)


def require_map(entry: Entry, contract: ObservationContract, scene: Path | None) -> None:
    """The same of one entry, by the observation in force and the MJCF of the robot.

    Raises:
        ContractError: It names what the observation or the robot does not have.
    """
    horizon = entry.horizons.observation_horizon
    Inputs(entry.observation, contract, observation_horizon=horizon)
    Outputs(entry.action, contract, scene=scene)
