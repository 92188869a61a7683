"""Which episode trains, validates, tests: by episode, causal in time, never by frame."""

import math
from collections.abc import Sequence
from typing import Any

from genpolicy.data.contract import SplitRule
from genpolicy.errors import ContractError
from genpolicy.integrity.documents import canonical_json
from genpolicy.integrity.hashing import sha256_bytes

SPLITS = ("train", "validation", "test")
RULE = "by episode, sorted by recording time: the earliest train, then validation, then test"


def assign_splits(
    recorded_at_ns: Sequence[int], uuids: Sequence[str], rule: SplitRule
) -> list[str]:
    """Split of each episode.

    Args:
        recorded_at_ns: When each recording began, ns; ties are ordered by UUID.
        uuids: Episode UUIDs.
        rule: The shares.

    Returns:
        One of `SPLITS` per episode, in the order given.

    Raises:
        ContractError: Fewer than three episodes: a split would be empty.
    """
    count = len(uuids)
    if count < len(SPLITS):
        raise ContractError(
            where="the dataset",
            found=f"{count} accepted episodes",
            expected="at least 3, one for each split",
            action="Record more episodes, or correct those refused.",
        )
    validation = max(1, math.floor(count * rule.validation))
    train = max(1, min(math.floor(count * rule.train), count - validation - 1))
    order = sorted(range(count), key=lambda i: (recorded_at_ns[i], uuids[i]))
    names = ["train"] * train + ["validation"] * validation
    names += ["test"] * (count - len(names))
    result = [""] * count
    for position, episode in enumerate(order):
        result[episode] = names[position]
    return result


def split_hash(rule: dict[str, Any], uuids: Sequence[str], splits: Sequence[str]) -> str:
    """SHA-256 of the rule and of every episode's place."""
    assignment = dict(zip(uuids, splits, strict=True))
    return sha256_bytes(canonical_json({"rule": rule, "assignment": assignment}))


def rule_as_json(rule: SplitRule) -> dict[str, Any]:
    """The rule as it stands in the manifest."""
    return {"text": RULE, "train": rule.train, "validation": rule.validation}
