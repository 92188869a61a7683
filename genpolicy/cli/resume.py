"""An interrupted audit goes on where it was: what was imported is kept beside the output.

The kept dataset is used again only for the same recordings (names, sizes, times of change), the
same contract and the same version; its bytes are verified like those of any dataset.
"""

import contextlib
import os
import shutil
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path

from genpolicy.data.formats import Opened, open_dataset
from genpolicy.data.formats.contract import ImportContract
from genpolicy.errors import BadInputError
from genpolicy.integrity.atomic import write_bytes
from genpolicy.integrity.documents import canonical_json, read_json
from genpolicy.integrity.hashing import sha256_bytes

KEY = "key.json"
DATASET = "dataset"


def work_folder(out: Path) -> Path:
    """Where an audit that writes `out` keeps what it may go on from."""
    return out.with_name(f".{out.name}.work")


def fingerprint(
    path: Path, *, format: str, contract: ImportContract | None, task: str | None
) -> str:
    """Hash of what decides how recordings are imported; contents by size and time of change."""
    files = sorted(path.rglob("*")) if path.is_dir() else [path]
    seen = [
        [str(file.relative_to(path)), file.stat().st_size, file.stat().st_mtime_ns]
        for file in files
        if file.is_file()
    ]
    rules = None if contract is None else contract.model_dump(mode="json")
    value = {
        "path": os.fspath(path.resolve()), "files": seen, "format": format, "contract": rules,
        "task": task, "version": version("genpolicy"),
    }  # fmt: skip
    return sha256_bytes(canonical_json(value))


def kept_or_new(work: Path, key: str, make: Callable[[Path], Opened]) -> Opened:
    """The kept dataset if it is the same import, else a new one.

    Args:
        work: The work folder.
        key: From `fingerprint`.
        make: Imports into the folder that it is given.
    """
    with contextlib.suppress(BadInputError):
        if read_json(work / KEY) == {"key": key}:
            return open_dataset(work / DATASET, out=work / DATASET)
    shutil.rmtree(work, ignore_errors=True)
    opened = make(work / DATASET)
    if opened.folder == work / DATASET:
        write_bytes(work / KEY, canonical_json({"key": key}))
    return opened
