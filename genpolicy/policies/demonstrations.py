"""What a training takes from the data beside the windows: demonstrations of one mode, the phase."""

from collections import Counter
from pathlib import Path

from genpolicy.data.dataset import Dataset
from genpolicy.data.recording.episode import PHASE_STREAM
from genpolicy.integrity.tables import read_table


def episodes_of_one_mode(table: Path, data: Dataset) -> list[str]:
    """Training episodes that followed the mode most of them followed; all where none is known.

    Which mode is right in a situation is not asked: a policy of one mode is used everywhere.

    Args:
        table: The audit's `demonstrated.parquet`.
        data: The dataset.

    Raises:
        BadInputError: The table is missing or changed.
    """
    episodes = data.episodes
    training = set(episodes["episode_uuid"][episodes["split"] == "train"])
    rows = [row for row in read_table(table).to_pylist() if row["episode_uuid"] in training]
    counts = Counter(row["mode"] for row in rows)
    if not counts:
        return sorted(training)
    largest = min(counts, key=lambda mode: (-counts[mode], mode))
    return sorted(row["episode_uuid"] for row in rows if row["mode"] == largest)


def phase_columns(data: Dataset) -> tuple[int, ...]:
    """Numbers of an observation that name the phase; empty where it is not observed."""
    found: list[int] = []
    start = 0
    for channel in data.manifest["observation_contract"]["channels"]:
        size = len(channel["components"])
        if channel["stream"] == PHASE_STREAM:
            found += range(start, start + size)
        start += size
    return tuple(found)
