"""Nothing that was learned from begins where the comparison begins.

Demonstrations train, and choose among trainings. A start that one of them has is no test of what
was learned from it: a policy that repeats it by heart succeeds there. Streams of their own draw
both, so that none is shared by chance; recordings that were brought may have any start.
"""

from collections.abc import Sequence
from pathlib import Path

from genpolicy.data.rows import EpisodeRow
from genpolicy.errors import ContractError
from genpolicy.integrity.documents import canonical_json, parse_json
from genpolicy.integrity.hashing import sha256_bytes
from genpolicy.integrity.rows import read_columns

EPISODES = "episodes.parquet"


def require_unseen(dataset: Path, starts: Sequence[str]) -> None:
    """Refuse a comparison that begins where a recorded episode does, of whatever split.

    Args:
        dataset: Folder of the dataset that all methods learn from.
        starts: Starts of the comparison as JSON, in their order.

    Raises:
        ContractError: A start is one of an episode, number for number.
    """
    path = dataset / EPISODES
    episodes = read_columns(path, EpisodeRow)
    names, begun = (episodes[name].to_pylist() for name in ("episode_uuid", "scene_start"))
    # Empty where nobody recorded it.
    recorded = {_sha256(text): name for name, text in zip(names, begun, strict=True) if text}
    shared = [number for number, start in enumerate(starts) if _sha256(start) in recorded]
    if shared:
        raise ContractError(
            where=str(path),
            found=f"{len(shared)} of {len(starts)} starts of the comparison among its episodes: "
            f"start {shared[0]} is where {recorded[_sha256(starts[shared[0]])]} begins",
            expected="no episode to learn from that begins where the comparison does",
            action="Leave these episodes out, or compare under another `seed`; then train again.",
        )


def _sha256(start: str) -> str:
    """Of a start as JSON, however it was written."""
    return sha256_bytes(canonical_json(parse_json(start.encode(), where="scene_start")))
