"""Which recorded runs still stand on each other: the lock file against itself.

A stage whose input another stage has written again since, or that a refusal kept from running
after that, has a record of an earlier ladder.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from gates.pipeline import LOCK, Disk, stages_of


def present_runs(root: Path) -> frozenset[str] | None:
    """Stages whose recorded run read what the runs below it wrote; None without a lock file.

    Raises:
        ConfigError: `dvc.lock` is malformed.
        IntegrityError: A file that a run read is a link.
    """
    if not (root / LOCK).is_file():
        return None
    runs = stages_of(root, LOCK)
    writers = {str(out.get("path")): name for name, run in runs.items() for out in _entries(run)}
    known: dict[str, bool] = {}
    disk = Disk(root, {})

    def stands(name: str) -> bool:
        if name not in known:
            known[name] = False  # a run that reads what it writes stands on nothing
            known[name] = all(sound(entry) for entry in runs[name].get("deps") or ())
        return known[name]

    def sound(entry: Mapping[str, Any]) -> bool:
        path, read = str(entry.get("path")), entry.get("md5")
        found = next((out for out in writers if path == out or path.startswith(f"{out}/")), None)
        if found is None:
            return True  # no stage wrote it: code, or what somebody brought
        if not stands(writers[found]):
            return False
        if path != found:
            return bool(disk.md5(path) == read)
        wrote = (
            out.get("md5") for out in _entries(runs[writers[found]]) if out.get("path") == path
        )
        return read in wrote

    return frozenset(name for name in runs if stands(name))


def _entries(run: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    return [entry for entry in run.get("outs") or () if isinstance(entry, dict)]
