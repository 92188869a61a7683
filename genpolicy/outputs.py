"""Files that somebody put where a stage writes: named before DVC removes them without a word.

Before DVC runs a stage, or brings back what it wrote earlier, it empties the stage's folder. A file
there is the stage's own if the recorded run lists its name, if DVC's cache holds its bytes, or if
nothing touched it since the stage ended well. Any other one would be lost.
"""

import configparser
import contextlib
import hashlib
from collections.abc import Mapping
from pathlib import Path, PurePosixPath
from typing import Any

from genpolicy.errors import BadInputError
from genpolicy.integrity.documents import read_json, read_yaml

PIPELINE, LOCK = "dvc.yaml", "dvc.lock"
ARTIFACTS, TIMES = "artifacts", "build/times"
CONFIGS = (".dvc/config", ".dvc/config.local")


def require_own_files(root: Path) -> None:
    """Stop before a stage replaces a folder in which somebody has put files of their own.

    Args:
        root: Folder with `dvc.yaml`.

    Raises:
        BadInputError: A file below `artifacts/` that no stage wrote; nothing was removed.
        ConfigError: `dvc.yaml` or `dvc.lock` is no YAML document.
    """
    recorded = _stages(root / LOCK)
    for stage in _stages(root / PIPELINE):
        own = _written(root, recorded.get(stage))
        for file in _files(root / ARTIFACTS / stage):
            name = file.relative_to(root).as_posix()
            if name in own or _is_cached(root, name) or _is_of_last_run(root, stage, file):
                continue
            raise BadInputError(
                where=name,
                found=f"a file that the stage {stage} did not write",
                expected=f"nothing else: {stage} replaces {ARTIFACTS}/{stage} as a whole",
                action="Move it to a folder of your own, then run it again; remove it if a run "
                "that was broken off left it there.",
            )


def _stages(path: Path) -> Mapping[str, Any]:
    """Entries by stage; none of a file that is not there, or that DVC itself will refuse."""
    document = read_yaml(path) if path.is_file() else {}
    stages = document.get("stages") if isinstance(document, dict) else None
    return stages if isinstance(stages, dict) else {}


def _files(folder: Path) -> list[Path]:
    """Files and links below a folder, what changed last first.

    Those that DVC ignores as well: they would go with the others.
    """
    found = [path for path in folder.rglob("*") if path.is_symlink() or not path.is_dir()]
    return sorted(found, key=lambda path: path.lstat().st_ctime_ns, reverse=True)


def _written(root: Path, run: Any) -> set[str]:
    """Files that the recorded run wrote; of a folder the cache knows which, else their number."""
    found: set[str] = set()
    outs: Any = run.get("outs") if isinstance(run, dict) else None
    for entry in outs if isinstance(outs, list) else ():
        if not isinstance(entry, dict):
            continue
        path, md5 = str(entry.get("path")), str(entry.get("md5"))
        found.add(path)
        listing = _cached(root, md5)
        if md5.endswith(".dir") and listing.is_file():
            found |= {str(PurePosixPath(path, item["relpath"])) for item in read_json(listing)}
        elif md5.endswith(".dir"):
            files = _files(root / path)
            few = len(files) <= entry.get("nfiles", len(files))
            found |= {file.relative_to(root).as_posix() for file in files if few}
    return found


def _is_cached(root: Path, name: str) -> bool:
    file = root / name
    if file.is_symlink():  # it has no bytes of its own
        return False
    with file.open("rb") as stream:
        digest = hashlib.file_digest(stream, lambda: hashlib.md5(usedforsecurity=False))
    return _cached(root, digest.hexdigest()).is_file()


def _is_of_last_run(root: Path, stage: str, file: Path) -> bool:
    """Whether it lay there, as it is, when the stage ended: only its own files do then.

    DVC may have been stopped before it recorded the run. The time is that of the last change of the
    entry, which moving a file sets and an old file does not bring along.
    """
    times = root / TIMES / f"{stage}.json"
    if not times.is_file():
        return False
    ended = read_json(times)
    well = isinstance(ended, dict) and ended.get("exit_code") == 0
    return well and file.lstat().st_ctime_ns <= times.stat().st_mtime_ns


def _cached(root: Path, md5: str) -> Path:
    """Where DVC keeps the bytes of this hash."""
    cache = root / ".dvc" / "cache"
    for name in CONFIGS:
        config = configparser.ConfigParser(interpolation=None)
        with contextlib.suppress(configparser.Error):  # DVC itself will refuse it
            config.read(root / name)
        cache = root / ".dvc" / config.get("cache", "dir", fallback=str(cache.resolve()))
    return cache / "files" / "md5" / md5[:2] / md5[2:]
