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
    of_task, task = str(IDENTITY), _at(identity, "name", where=str(IDENTITY))
    stated = {
        name: (
            _at(manifest, f"{name}_contract", "sha256", where=where),
            _at(identity, f"{name}_sha256", where=of_task),
        )
        for name in CONTRACTS
    }
    stated["phase"] = (
        _at(manifest, "phases", where=where), _at(identity, "phases", "all", where=of_task)
    )  # fmt: skip
    for name, (found, expected) in stated.items():
        _require(f"{where}: {name}", found, expected, f"as {task} defines it")


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
            config = read_json(path)
            task = _at(identity, "name", where=str(IDENTITY))
            for name in CONTRACTS:
                found = _at(config, "provenance", f"{name}_contract_sha256", where=str(path))
                expected = _at(identity, f"{name}_sha256", where=str(IDENTITY))
                _require(f"{path}: {name}", found, expected, f"as {task} defines it")
            if dataset:
                found = _at(config, "provenance", "dataset_manifest_sha256", where=str(path))
                _require(f"{path}: dataset", found, sha256_file(MANIFEST), str(MANIFEST))


def _at(document: Any, *keys: str, where: str) -> Any:
    """What stands at these keys of a document.

    Raises:
        ContractError: It stops before, or ends with nothing.
    """
    value = document
    for key in keys:
        value = value.get(key) if isinstance(value, Mapping) else None
    if value is None:
        raise ContractError(
            where=f"{where}: {'.'.join(keys)}",
            found="missing",
            expected="what its stage wrote there",
            action="Restore the file, or run the stage that writes it (`dvc repro`).",
        )
    return value


def _require(where: str, found: object, expected: object, what: str) -> None:
    if found != expected:
        raise ContractError(
            where=where,
            found=f"{found}"[:80],
            expected=f"{expected}"[:80] + f" ({what})",
            action="Bring data and checkpoints of this task: name them in params.yaml: source, "
            "then run `dvc repro`.",
        )
