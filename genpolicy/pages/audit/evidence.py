"""The audit's evidence folder, read back: a page can show only what was written."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pandas as pd

from genpolicy.audit.documents import PERSISTENCE, SUMMARY, Persistence, Summary
from genpolicy.audit.reach_rows import FURTHER_TABLES
from genpolicy.audit.rows import TABLES
from genpolicy.integrity.documents import read_json
from genpolicy.integrity.hashing import sha256_file
from genpolicy.integrity.rows import read_columns


@dataclass(frozen=True)
class AuditEvidence:
    """Tables and documents of one audit.

    Attributes:
        tables: By name, without the suffix.
        summary: Counts and names, `summary.json`.
        settings: What the audit was made with, `settings.json`.
        persistence: Identity over time, `persistence.json`.
        digests: SHA-256 of every file, by name.
        origins: What the user calls an episode, by identifier; none is in the folder itself.
        coverage: Coverage of every interval that is shown; NaN where nobody said which.
    """

    tables: Mapping[str, pd.DataFrame]
    summary: Summary
    settings: Mapping[str, Any]
    persistence: Persistence
    digests: Mapping[str, str]
    origins: Mapping[str, str] = field(default_factory=dict)
    coverage: float = math.nan

    def __getitem__(self, name: str) -> pd.DataFrame:
        return self.tables[name]


def read_evidence(folder: Path) -> AuditEvidence:
    """Read what `genpolicy.audit.evidence.write_evidence` wrote.

    Raises:
        BadInputError: A file is missing or damaged.
        IntegrityError: A table with unknown or missing columns, or a document with other keys.
    """
    tables = {
        name: read_columns(folder / f"{name}.parquet", row).to_pandas()
        for name, row in (TABLES | FURTHER_TABLES).items()
    }
    files = sorted(path for path in folder.iterdir() if path.is_file())
    return AuditEvidence(
        tables=tables,
        summary=SUMMARY.read(folder),
        settings=read_json(folder / "settings.json"),
        persistence=PERSISTENCE.read(folder),
        digests={path.name: sha256_file(path) for path in files},
    )
