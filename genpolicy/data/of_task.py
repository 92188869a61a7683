"""Recordings of a task to its dataset, held against the contract of the task.

Stage `ingest` asks this, and whoever derives a dataset again.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from genpolicy.contract.settings import Settings
from genpolicy.data.contract import TCP_ACTION, IngestContract, SplitRule, plausible_ranges
from genpolicy.data.ingest import ingest_recordings
from genpolicy.tasks.api import load_task


class IngestSection(Settings):
    """Section `ingest` of `params.yaml`.

    Attributes:
        train: Share of the training split.
        validation: Share of the validation split; the rest is the test.
    """

    train: float
    validation: float


def ingest_of_task(
    files: Sequence[Path], out: Path, *, task: str, action_period_s: float, section: IngestSection
) -> None:
    """Hold recordings against the contract of a task, and write the dataset folder.

    Args:
        files: MCAP recordings, one episode each.
        out: The dataset folder; whole or not at all, an old one is replaced.
        task: Name of the task that each must name as its own.
        action_period_s: Time between two actions, s.
        section: Shares of the splits.

    Raises:
        ContractError: No recording, or too few of them, were accepted.
        ConfigError: No such task, or shares that leave no test split.
        BadInputError: The folder cannot be written.
    """
    known = load_task(task)
    contract = IngestContract(
        observation=known.observation,
        phases=known.phases,
        action_period_s=action_period_s,
        joint_range_rad=(
            tuple(known.limits.position_lower_rad.tolist()),
            tuple(known.limits.position_upper_rad.tolist()),
        ),
        ranges=plausible_ranges(
            known.observation,
            TCP_ACTION,
            workspace_lower_m=np.array(known.workspace.lower_m),
            workspace_upper_m=np.array(known.workspace.upper_m),
        ),
    )
    split = SplitRule(train=section.train, validation=section.validation)
    ingest_recordings(files, contract=contract, out=out, task=task, split=split)
