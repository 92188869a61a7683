"""What a training takes from the data beside the windows: demonstrations of one mode, the phase."""

from collections import Counter
from collections.abc import Mapping

from genpolicy.data.dataset import Dataset
from genpolicy.data.recording.episode import PHASE_STREAM


def episodes_of_one_mode(followed: Mapping[str, str], data: Dataset) -> list[str]:
    """Training episodes that followed the mode most of them followed; all where none is known.

    Which mode is right in a situation is not asked: a policy of one mode is used everywhere.

    Args:
        followed: Mode by episode, as the audit saw it.
        data: The dataset.
    """
    episodes = data.episodes
    training = set(episodes["episode_uuid"][episodes["split"] == "train"])
    own = {uuid: mode for uuid, mode in followed.items() if uuid in training}
    counts = Counter(own.values())
    if not counts:
        return sorted(training)
    largest = min(counts, key=lambda mode: (-counts[mode], mode))
    return sorted(uuid for uuid, mode in own.items() if mode == largest)


def phase_columns(data: Dataset) -> tuple[int, ...]:
    """Numbers of an observation that name the phase; empty where it is not observed."""
    contract = data.observation_contract
    seen = [c.name for c in contract.channels if c.stream == PHASE_STREAM]
    return tuple(n for name in seen for n in range(contract.dim)[contract.slices[name]])
