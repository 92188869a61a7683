"""Task, dataset and checkpoints must speak of the same observations and actions."""

from collections.abc import Mapping
from typing import Any

from genpolicy.errors import ContractError
from genpolicy.integrity.documents import read_json
from genpolicy.integrity.hashing import sha256_file
from stages._stage import ARTIFACTS

IDENTITY = ARTIFACTS / "task" / "identity.json"
MANIFEST = ARTIFACTS / "ingest" / "manifest.json"
CONTRACTS = ("observation", "action")


def require_contract_of_task(manifest: Mapping[str, Any], *, where: str) -> None:
    """Refuse a dataset of another contract than the task's.

    Args:
        manifest: The dataset's manifest.
        where: What errors call it.

    Raises:
        ContractError: Other observations, other actions or other phases than the task has.
    """
    identity = read_json(IDENTITY)
    stated = {name: (manifest[f"{name}_contract"]["sha256"], identity[f"{name}_sha256"])
              for name in CONTRACTS}  # fmt: skip
    stated["phase"] = (list(manifest["phases"]), identity["phases"]["all"])
    for name, (found, expected) in stated.items():
        _require(f"{where}: {name}", found, expected, f"as {identity['name']} defines it")


def require_one_contract(*trained: str, dataset: bool = True) -> None:
    """Refuse to work on a dataset or a checkpoint of another contract than the task's.

    Args:
        trained: Stages whose checkpoints are read.
        dataset: Whether the stage reads the dataset too; then every checkpoint is of that one.

    Raises:
        ContractError: A contract that differs, or a checkpoint of another dataset.
    """
    identity = read_json(IDENTITY)
    if dataset:
        require_contract_of_task(read_json(MANIFEST), where=str(MANIFEST))
    for stage in trained:
        for path in sorted((ARTIFACTS / stage).glob("*/seed_*/config.json")):
            provenance = read_json(path)["provenance"]
            for name in CONTRACTS:
                found, expected = provenance[f"{name}_contract_sha256"], identity[f"{name}_sha256"]
                _require(f"{path}: {name}", found, expected, f"as {identity['name']} defines it")
            if dataset:
                found = provenance["dataset_manifest_sha256"]
                _require(f"{path}: dataset", found, sha256_file(MANIFEST), str(MANIFEST))


def _require(where: str, found: object, expected: object, what: str) -> None:
    if found != expected:
        raise ContractError(
            where=where,
            found=f"{found}"[:80],
            expected=f"{expected}"[:80] + f" ({what})",
            action="Bring data and checkpoints of this task: name them in params.yaml: source, "
            "then run `dvc repro`.",
        )
