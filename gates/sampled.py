"""A sample that is asked again, of what somebody wrote and nobody can ask all of.

It is drawn by a hash of all the files that were written together, so that whoever changes one of
them draws all samples anew, and all must miss at once. By the hash of a single file a lie in it was
tried out until its own sample missed it. Whoever writes all of them can still try again and again,
offline: each lie more makes it more tries.
"""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TypeVar

from genpolicy.integrity.documents import canonical_json
from genpolicy.integrity.hashing import sha256_bytes, sha256_file
from genpolicy.seeds import stream

Item = TypeVar("Item")

ROLLOUTS = "rollouts.parquet"
"""What is said of the rollouts of a folder, beside its folder of journals."""


def salt_of(files: Iterable[Path]) -> str:
    """A hash of files that were written together, by name; those that are not there are not in it.

    Raises:
        IntegrityError: No regular file.
    """
    found = sorted(path for path in set(files) if path.exists())
    return sha256_bytes(canonical_json([[path.name, sha256_file(path)] for path in found]))


def some(items: Sequence[Item], count: int, *, name: str, salt: str) -> list[Item]:
    """At most so many of the items, in their order.

    Args:
        items: All of them.
        count: How many are asked at most.
        name: What they are of, so that two samples of one salt have nothing to do with each other.
        salt: As `salt_of` gives it.
    """
    generator = stream(0, "drawn again", name, salt)
    chosen = generator.choice(len(items), size=min(count, len(items)), replace=False)
    return [items[i] for i in sorted(chosen.tolist())]
