"""Trained policies that are only files, and the two hashes by which a journal names each."""

import hashlib
import json

from genpolicy.integrity.documents import canonical_json

SAMPLER = {"name": "euler", "steps": 4}
STAGES = {"bc": "train_baselines"}
"""Where a policy was trained that is no generator."""


def _sha(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def _config(method: str) -> bytes:
    return json.dumps({"method": method, "sampler": SAMPLER}).encode()


def maker(method: str) -> tuple[str, str]:
    """Identity of a policy of `write_policy`, by hand: weights with configuration, and sampler."""
    weights, config = _sha(method.encode()), _sha(_config(method))
    return _sha(f"{weights}\n{config}\n".encode()), _sha(canonical_json(SAMPLER))


def write_policy(root, method: str, *, seed: int = 0) -> None:
    """The files of a policy, where its stage leaves them."""
    stage = STAGES.get(method, "train_generators")
    folder = root / "artifacts" / stage / method / f"seed_{seed}"
    folder.mkdir(parents=True)
    (folder / "config.json").write_bytes(_config(method))
    (folder / "model.safetensors").write_bytes(method.encode())
