"""What the user calls an episode: its file and number, in place of our identifier.

Findings name episodes by identifier, which exists in no file of the user's. The dataset keeps
where each came from (`source_file`: "x.hdf5#demo_7", "data/chunk-000/episode_000003.parquet").
"""

import re
from collections.abc import Mapping
from typing import Any

from genpolicy.data.dataset import Dataset
from genpolicy.pages.audit.evidence import AuditEvidence

IDENTIFIER = re.compile(r"\b[0-9a-f]{8}(?:-[0-9a-f]{4}){3}-[0-9a-f]{12}\b")

LONGEST = 24  # characters, over a picture


def origins_of(dataset: Dataset) -> dict[str, str]:
    """File and number of each episode, by identifier; empty where the dataset kept none."""
    table = dataset.episodes
    if "source_file" not in table:
        return {}
    pairs = zip(table["episode_uuid"], table["source_file"], strict=True)
    return {str(uuid): str(file) for uuid, file in pairs if file}


def origins_shown(
    document: Mapping[str, Any], evidence: AuditEvidence, origins: Mapping[str, str]
) -> dict[str, str]:
    """Those of the episodes that `audit.json` or the page of this evidence names.

    Args:
        document: `audit.json`.
        evidence: The evidence beside it.
        origins: Of all episodes.
    """
    replay = evidence["replay"]
    shown = _identifiers(document) | _identifiers(evidence.summary.notes)
    shown |= set(evidence["examples"]["query_uuid"])
    shown |= set(replay.loc[replay["label"] != replay["replayed"], "episode_uuid"])
    return {uuid: origins[uuid] for uuid in sorted(shown & set(origins))}


def named(value: Any, origins: Mapping[str, str]) -> Any:
    """The same value with each known identifier in its texts replaced by file and number."""
    if isinstance(value, str):
        return IDENTIFIER.sub(lambda found: origins.get(found[0], found[0]), value)
    if isinstance(value, Mapping):
        return {key: named(part, origins) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [named(part, origins) for part in value]
    return value


def short_name(origin: str) -> str:
    """The number of the episode where the file holds several, else the file; for a figure."""
    name = origin.rsplit("/", 1)[-1].rsplit("#", 1)[-1]
    return name if len(name) <= LONGEST else f"…{name[1 - LONGEST :]}"


def _identifiers(value: Any) -> set[str]:
    if isinstance(value, str):
        return set(IDENTIFIER.findall(value))
    parts = value.values() if isinstance(value, Mapping) else value
    if isinstance(value, Mapping | list | tuple):
        return {name for part in parts for name in _identifiers(part)}
    return set()
