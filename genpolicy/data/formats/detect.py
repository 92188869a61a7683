"""Which layout is this? Told by what is there, never by trying to read it.

Nothing heavier than the standard library is imported: a mistake in a path is told at once.
"""

import os
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn

from genpolicy.errors import BadInputError

DATASET = "dataset"
# Named here once more, because their home loads every table library; a test holds both together.
MANIFEST_FILE, FRAMES_FILE = "manifest.json", "frames.parquet"
AUDIT_FILES = ("audit.json", "audit.html", f"{DATASET}/{MANIFEST_FILE}")
"""What `genpolicy audit` writes: never recordings, wherever it was told to write it."""
HDF5_SUFFIXES = (".hdf5", ".h5", ".hdf")
HDF5_MAGIC = b"\x89HDF\r\n\x1a\n"
PARQUET_MAGIC = b"PAR1"
MCAP_MAGIC = b"\x89MCAP0\r\n"
PARQUET_SUFFIXES = (".parquet", ".pq", ".parq")
LAYOUT_OF = {
    ".mcap": "mcap",
    **dict.fromkeys(PARQUET_SUFFIXES, "parquet"),
    **dict.fromkeys(HDF5_SUFFIXES, "robomimic"),
}
"""By the end of a file's name, whatever its case."""
SHOWN = 5
# A whole disk is not walked to count what is on it.
MOST_DATASETS = 50
MOST_NAMED = 100_000
CHECK = "Check the path, or name the layout with --format."


@dataclass
class Contents:
    """What lies in a folder, by name only.

    Attributes:
        files: Files of recordings by layout, relative POSIX paths, sorted.
        datasets: Folders below that are data sets of their own; no more are looked for after
            `MOST_DATASETS`.
        others: How many other files there are, by suffix.
        beside: Those other files, no more than `MOST_NAMED`.
    """

    files: dict[str, list[str]] = field(default_factory=dict)
    datasets: list[str] = field(default_factory=list)
    others: Counter[str] = field(default_factory=Counter)
    beside: list[str] = field(default_factory=list)


def detect(path: Path) -> str:
    """Name of the layout of `path`, or `dataset`.

    Raises:
        BadInputError: Missing, not readable, of no known layout, of several at once, or a folder
            above data sets; those are named.
    """
    try:
        if not path.exists():
            _refuse(path, "missing", "a file or folder of recordings")
        return _folder(path) if path.is_dir() else _file(path)
    except OSError as error:
        refuse_unreadable(path, error)


def check_named(path: Path, layout: str) -> None:
    """Refuse a layout that a user named for what cannot be one, by what is there.

    Raises:
        BadInputError: It cannot.
    """
    try:
        suffix = {"mcap": ".mcap", "parquet": ".parquet"}.get(layout)
        if layout == "robomimic" and only_hdf5(path).is_dir():
            _refuse(path, "a folder", "one HDF5 file, as --format robomimic says")
        if layout == "lerobot" and not (path / "meta" / "info.json").is_file():
            _refuse(path, "without meta/info.json", "a LeRobot dataset, as --format says")
        if layout == "zarr" and not path.is_dir():
            _refuse(path, "a file", "a folder of Zarr arrays, as --format zarr says")
        if suffix and path.is_dir() and not contents(path, into_whole=True).files.get(layout):
            _refuse(
                path,
                f"without a {suffix} file",
                f"a file, or a folder of them, as --format {layout} says",
            )
    except OSError as error:
        refuse_unreadable(path, error)


def only_hdf5(path: Path) -> Path:
    """The HDF5 file of a folder that holds a single one; any other path as it is.

    Raises:
        BadInputError: A folder cannot be listed.
    """
    try:
        names = contents(path).files.get("robomimic", []) if path.is_dir() else []
    except OSError as error:
        refuse_unreadable(path, error)
    return path / names[0] if len(names) == 1 else path


def named_layout(name: str) -> str | None:
    """The layout of recordings that the end of a file's name says; None of another file."""
    return LAYOUT_OF.get(Path(name).suffix.lower())


def contents(path: Path, *, into_whole: bool = False) -> Contents:
    """What lies in a folder and below it; no file is opened, no link is followed.

    Args:
        path: The folder.
        into_whole: Whether to look into data sets below it as well.

    Raises:
        OSError: A folder cannot be listed: what lies in it would be left out in silence.
    """
    found = Contents()
    for here, folders, files in os.walk(path, onerror=_raise):
        folders.sort()
        place = Path(here)
        if place != path and all((place / name).is_file() for name in AUDIT_FILES):
            folders.clear()
            continue
        if place != path and not into_whole and _whole(place):
            found.datasets.append(place.relative_to(path).as_posix())
            folders.clear()
            if len(found.datasets) == MOST_DATASETS:
                break
            continue
        for name in sorted(files):
            layout = named_layout(name)
            relative = (place / name).relative_to(path).as_posix()
            if layout is None:
                found.others[Path(name).suffix or "no suffix"] += 1
                if len(found.beside) < MOST_NAMED:
                    found.beside.append(relative)
            else:
                found.files.setdefault(layout, []).append(relative)
    return found


def files_of(path: Path, layout: str) -> list[Path]:
    """Files of one layout at or below a path, sorted; what an audit wrote is not among them.

    Raises:
        BadInputError: A folder cannot be listed.
    """
    if not path.is_dir():
        return [path]
    try:
        names = contents(path, into_whole=True).files.get(layout, [])
    except OSError as error:
        refuse_unreadable(path, error)
    return sorted(path / name for name in names)


def refuse_unreadable(path: Path, error: OSError) -> NoReturn:
    """Raise the error of a place that cannot be looked into."""
    where = path if error.filename is None else Path(os.fsdecode(error.filename))
    raise BadInputError(
        where=str(where),
        found=f"not readable ({error.strerror or error})",
        expected="files and folders that you may read",
        action="Check the path and its permissions.",
    ) from error


def listed(names: list[str]) -> str:
    """The first names, and how many more."""
    more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    return ", ".join(names[:SHOWN]) + more


def _whole(path: Path) -> str:
    """The layout of a folder that is a data set as a whole; empty for any other."""
    if (path / MANIFEST_FILE).is_file() and (path / FRAMES_FILE).is_file():
        return DATASET
    if (path / "meta" / "info.json").is_file():
        return "lerobot"
    described = any((path / name).is_file() for name in (".zgroup", "zarr.json"))
    if described or (path / "meta" / "episode_ends").is_dir():
        return "zarr"
    return ""


def _folder(path: Path) -> str:
    whole = _whole(path)
    if whole == "lerobot":
        _check_alone(path, contents(path))
    if whole == "zarr":
        contents(path, into_whole=True)  # an array that may not be listed would be left out
    if whole:
        return whole
    found = contents(path)
    if found.datasets:
        loose = [name for names in found.files.values() for name in names]
        more = " or more" if len(found.datasets) == MOST_DATASETS else ""
        beside = f", beside {listed(loose)}" if loose else ""
        _refuse(
            path,
            f"a folder above {_count(len(found.datasets), 'data set')}{more} "
            f"({listed(found.datasets)}{beside})",
            "one data set",
            "Give one of them.",
        )
    if len(found.files) > 1:
        shown = "; ".join(f"{kind}: {listed(names)}" for kind, names in found.files.items())
        _refuse(path, f"of several layouts at once ({shown})", "one layout")
    if not found.files:
        _refuse_unknown(path, _others(found.others))
    ((layout, names),) = found.files.items()
    if layout == "robomimic" and len(names) > 1:
        _refuse(
            path,
            f"a folder of {_count(len(names), 'HDF5 file')} ({listed(names)})",
            "one file: each is a data set",
            "Give one of them.",
        )
    below = sorted({name.split("/")[0] for name in names if "/" in name})
    if len(below) > 1 and not any("/" not in name for name in names):
        _refuse(
            path,
            f"without recordings of its own: they lie in {len(below)} folders ({listed(below)})",
            "one data set",
            f"Give one of these folders, or read all as one with --format {layout}.",
        )
    return layout


def _check_alone(path: Path, found: Contents) -> None:
    """A LeRobot folder holds its own tables only: what else lies there would be ignored."""
    strange = [name for kind, names in found.files.items() if kind != "parquet" for name in names]
    strange += found.datasets
    if strange:
        _refuse(
            path,
            f"a LeRobot dataset that also holds {listed(strange)}",
            "one data set of one layout",
            "Give one of them, or leave the rest aside with --format lerobot.",
        )


def _file(path: Path) -> str:
    if not path.is_file():
        _refuse(path, "a device or a pipe", "a regular file, or a folder")
    with path.open("rb") as stream:
        head = stream.read(8)
    named = named_layout(path.name)
    if head == HDF5_MAGIC or named == "robomimic":
        return "robomimic"
    if head[:4] == PARQUET_MAGIC or named == "parquet":
        return "parquet"
    if head == MCAP_MAGIC or named == "mcap":
        return "mcap"
    _refuse_unknown(path, f"a {path.suffix} file" if path.suffix else "no suffix that is known")


def _refuse_unknown(path: Path, what: str) -> NoReturn:
    csv = ".csv" in what or ".tsv" in what
    packed = " .zip" in what or " .gz" in what or " .tar" in what
    action = "Unpack it first." if packed else CHECK
    _refuse(
        path,
        f"of no known layout ({what})",
        "a dataset folder, MCAP files, a Zarr replay buffer, a LeRobot dataset, a robomimic "
        "HDF5 file or Parquet files",
        "Convert the text to Parquet first; docs/import.md says which columns." if csv else action,
    )


def _others(others: Counter[str]) -> str:
    if not others:
        return "it holds no file"
    return "it holds " + ", ".join(f"{n} {suffix}" for suffix, n in others.most_common(SHOWN))


def _count(number: int, word: str) -> str:
    return f"{number} {word}" + ("" if number == 1 else "s")


def _raise(error: OSError) -> NoReturn:
    raise error


def _refuse(path: Path, found: str, expected: str, action: str = CHECK) -> NoReturn:
    raise BadInputError(where=str(path), found=found, expected=expected, action=action)
