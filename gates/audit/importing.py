"""What `genpolicy audit` takes, and its recordings as a dataset: all that comes before the audit.

Apart from what audits, which loads all of science: recordings that cannot be read are told first.
"""

import sys
from dataclasses import dataclass
from pathlib import Path

from genpolicy.cli.ingest import Recordings, given_contract
from genpolicy.cli.resume import fingerprint, kept_or_new, work_folder
from genpolicy.data.formats import Opened, open_dataset
from genpolicy.progress import ProgressLine


@dataclass(frozen=True)
class AuditOptions(Recordings):
    """What the command takes: recordings, where to write, limits, and the root of all draws."""

    out: Path = Path("audit")
    limits: Path | None = None
    seed: int = 0


def import_recordings(options: AuditOptions) -> Opened:
    """The recordings as a dataset: kept from an interrupted audit, or imported now.

    Raises:
        BadInputError: They cannot be read, or the contract does not fit them.
    """
    contract = given_contract(options)
    work = work_folder(options.out)
    progress = ProgressLine("episodes")

    def make(folder: Path) -> Opened:
        return open_dataset(
            options.path,
            out=folder,
            format=options.format,
            contract=contract,
            task=options.task,
            progress=progress,
        )

    key = fingerprint(options.path, format=options.format, contract=contract, task=options.task)
    try:
        return kept_or_new(work, key, make)
    finally:
        progress.close()


def say(text: str) -> None:
    """Tell whoever waits, beside what is printed."""
    print(f"genpolicy audit: {text}", file=sys.stderr, flush=True)
