"""Stage `ingest`: recordings become a dataset; what breaks the contract is refused by name.

Recordings come from the stage `record` or from a folder of one's own (`source`); a dataset that
`genpolicy ingest` wrote enters as it is.
"""

import math
import shutil

from genpolicy.data.dataset import load_dataset
from genpolicy.data.of_task import IngestSection, ingest_of_task
from genpolicy.errors import ContractError
from genpolicy.integrity.atomic import output_folder
from stages._contracts import require_contract_of_task
from stages._source import SourceSection, require_unchanged
from stages._stage import ARTIFACTS, Params, main


def work(params: Params) -> None:
    """Hold every recording, or a dataset as a whole, against the task's contract."""
    source = params.section("source", SourceSection)
    if source.kind == "dataset":
        take_dataset(source, period_s=params.horizons.action_period_s)
        return
    recorded = sorted((ARTIFACTS / "record" / "episodes").glob("*.mcap"))
    ingest_of_task(
        recorded if source.kind == "embedded" else require_unchanged(source),
        ARTIFACTS / "ingest",
        task=params.task.name,
        action_period_s=params.horizons.action_period_s,
        section=params.section("ingest", IngestSection),
    )


def take_dataset(source: SourceSection, *, period_s: float) -> None:
    """Copy a dataset that `genpolicy ingest` wrote, once it is shown to be one of this task.

    Its split is its own; the section `ingest` does not apply.

    Args:
        source: Where it lies; it is read only.
        period_s: The action period of the ladder, s.

    Raises:
        ContractError: Another contract or another rate than the task's and the ladder's.
        IntegrityError: A byte is other than its manifest says.
    """
    files = require_unchanged(source)
    manifest = load_dataset(source.folder).manifest
    require_contract_of_task(manifest, where=str(source.folder))
    found = float(manifest["action_contract"]["period_s"])
    if not math.isclose(found, period_s, rel_tol=1e-9):
        raise ContractError(
            where=f"{source.folder}: action period",
            found=f"{found:g} s",
            expected=f"{period_s:g} s, as params.yaml: horizons.action_period_s",
            action="Ingest it at that rate, or change the horizons.",
        )
    with output_folder(ARTIFACTS / "ingest") as folder:
        for path in files:
            shutil.copyfile(path, folder / path.name)


if __name__ == "__main__":
    main("ingest", work)
