"""The split of a dataset by one hash: which episodes may train a policy, and which may judge it."""

from collections.abc import Mapping

from genpolicy.integrity.documents import canonical_json
from genpolicy.integrity.hashing import sha256_bytes


def split_sha256(manifest: Mapping[str, object]) -> str:
    """SHA-256 of the canonical JSON of `split` of a manifest: its rule, hash and counts.

    The successful episodes of the training split follow from it. `split.sha256` of the manifest is
    one part of it, and another number.
    """
    return sha256_bytes(canonical_json(manifest["split"]))
