"""Stage `ingest`: recordings become a dataset; what breaks the contract is refused by name."""

import numpy as np

from genpolicy.contract.settings import Settings
from genpolicy.data.contract import TCP_ACTION, IngestContract, SplitRule, plausible_ranges
from genpolicy.data.ingest import ingest_recordings
from genpolicy.tasks.api import load_task
from stages._stage import ARTIFACTS, Params, main


class IngestSection(Settings):
    """Section `ingest`.

    Attributes:
        train: Share of the training split.
        validation: Share of the validation split; the rest is the test.
    """

    train: float
    validation: float


def work(params: Params) -> None:
    """Hold every recording against the task's contract and write the dataset."""
    section = params.section("ingest", IngestSection)
    task = load_task(params.task.name)
    limits = task.limits
    contract = IngestContract(
        observation=task.observation,
        phases=task.phases,
        action_period_s=params.horizons.action_period_s,
        joint_range_rad=(
            tuple(limits.position_lower_rad.tolist()),
            tuple(limits.position_upper_rad.tolist()),
        ),
        ranges=plausible_ranges(
            task.observation,
            TCP_ACTION,
            workspace_lower_m=np.array(task.workspace.lower_m),
            workspace_upper_m=np.array(task.workspace.upper_m),
        ),
    )
    ingest_recordings(
        sorted((ARTIFACTS / "record" / "episodes").glob("*.mcap")),
        contract=contract,
        out=ARTIFACTS / "ingest",
        split=SplitRule(train=section.train, validation=section.validation),
    )


if __name__ == "__main__":
    main("ingest", work)
