"""Files beside the recordings, which nobody reads: named, so that what they say is not missed.

What a person wrote of the episodes into `annotations.csv` may be what decides. A file of unknown
make is not opened; its name says where to look.
"""

import os
import re
from collections.abc import Callable, Collection
from pathlib import Path

from genpolicy.data.formats.detect import contents, listed, named_layout, refuse_unreadable

ADVICE = "What they say of the episodes is not asked; write it into the recordings."
# What belongs to a published data set as such, and says nothing of one episode.
PAPERS = re.compile(r"(README|LICEN[CS]E|CITATION|CHANGELOG)(\.\w+)?", re.IGNORECASE)
ZARR_FOLDERS = ("", "meta", "data")

Known = Callable[[str], bool]


def of_folder(root: Path, known: Known) -> tuple[str, ...]:
    """The note on the files of a folder that are not read; none where there are none.

    Args:
        root: The folder of the recordings.
        known: Says of a relative POSIX path whether it is read, or belongs to the layout.

    Raises:
        BadInputError: A folder cannot be listed.
    """
    try:
        found = contents(root, into_whole=True)
    except OSError as error:
        refuse_unreadable(root, error)
    names = [*found.beside, *(name for names in found.files.values() for name in names)]
    return _note(sorted(name for name in names if not _is_of_all(name) and not known(name)))


def of_file(path: Path) -> tuple[str, ...]:
    """The note on files that begin with the name of a recording, beside it."""
    try:
        names = sorted(entry.name for entry in os.scandir(path.parent) if entry.is_file())
    except OSError:
        return ()
    stem = path.name.split(".")[0]
    called = [
        name
        for name in names
        if stem and name != path.name and re.match(rf"{re.escape(stem)}(?![^\W_])", name)
    ]
    return _note([name for name in called if named_layout(name) is None])


def of_zarr(root: Path) -> tuple[str, ...]:
    """The note on files in and beside a Zarr group that are no part of it."""
    inside: list[str] = []
    for place in ZARR_FOLDERS:
        folder = root / place
        if folder.is_dir() and not (folder / ".zarray").is_file():
            inside += [
                (Path(place) / entry.name).as_posix()
                for entry in os.scandir(folder)
                if entry.is_file() and entry.name != "zarr.json"
            ]
    return (*_note(sorted(name for name in inside if not _is_of_all(name))), *of_file(root))


def among(names: Collection[str]) -> Known:
    """Known are these names."""
    return lambda name: name in names


def _is_of_all(name: str) -> bool:
    parts = name.split("/")
    hidden = any(part.startswith(".") for part in parts)
    return hidden or PAPERS.fullmatch(parts[-1]) is not None


def _note(names: list[str]) -> tuple[str, ...]:
    if not names:
        return ()
    return (f"Not read, beside the recordings: {listed(names)}. {ADVICE}",)
