"""What can be wrong with a command's paths, asked before anything heavy is imported or read.

Every mistake here is one sentence and exit code 2, within a moment and with nothing written.
"""

import os
import shutil
from pathlib import Path
from typing import NoReturn

from genpolicy.data.formats.detect import (
    DATASET,
    check_named,
    detect,
    named_layout,
    refuse_unreadable,
)
from genpolicy.data.formats.ends import check_ends
from genpolicy.errors import BadInputError, ConfigError

# An import stores numbers only, so that recordings with pictures need far less than they hold:
# never more is asked for than the largest audit (1 M frames) may take.
MOST_ROOM_BYTES = 4 << 30
MIB = 1 << 20


def check_import(path: Path, out: Path, *, format: str, contract: Path | None) -> str:
    """Everything about the paths of an import but what lies at `out`; returns the layout.

    Raises:
        BadInputError: One of them is wrong.
    """
    check_settings(contract, "--contract", "")
    layout = check_recordings(path, format)
    check_apart(path, out)
    check_writable(path, out, layout)
    return layout


def check_recordings(path: Path, format: str) -> str:
    """Refuse recordings that are missing, unreadable, ambiguous or cut off; returns the layout.

    Args:
        path: File or folder.
        format: Layout as the user names it, or `auto`.

    Raises:
        BadInputError: They are.
    """
    try:
        there = path.exists()
        if there and path.is_dir():
            os.scandir(path).close()
    except OSError as error:
        refuse_unreadable(path, error)
    layout = detect(path) if format == "auto" or not there else format
    if layout == format:
        check_named(path, layout)
    check_ends(path, layout)
    return layout


def check_given(path: Path | None, option: str) -> None:
    """Refuse a file that an option names and that is not there.

    Raises:
        ConfigError: Missing, a folder, or not readable.
    """
    try:
        if path is None:
            return
        found = "missing" if not path.exists() else "" if path.is_file() else "not a file"
        if not found:
            path.open("rb").close()
            return
    except OSError as error:
        found = f"not readable ({error.strerror or error})"
    raise ConfigError(
        where=f"{option} {path}",
        found=found,
        expected="a file that you may read",
        action="Check the path.",
    )


def check_settings(path: Path | None, option: str, section: str) -> None:
    """Refuse a file of settings that is missing, or no mapping, or without a section.

    Args:
        path: The file; None where the option was not given.
        option: What the user typed.
        section: Key that it must have; empty: none.

    Raises:
        ConfigError: It is.
    """
    check_given(path, option)
    if path is None:
        return
    from genpolicy.integrity.documents import read_yaml  # noqa: PLC0415 - only where it is given

    document = read_yaml(path)
    found = "" if isinstance(document, dict) else "no mapping"
    if not found and section and section not in document:
        found = f"without the section {section}"
    if found:
        raise ConfigError(
            where=f"{option} {path}",
            found=found,
            expected=f"a mapping with the section {section}" if section else "a mapping",
            action="Check the path.",
        )


def check_apart(path: Path, out: Path) -> None:
    """Refuse an output in or around the recordings.

    Raises:
        BadInputError: It would write into them, or over them.
    """
    source, target = path.resolve(), out.resolve()
    if source.is_relative_to(target) or target.is_relative_to(source):
        _refuse(
            f"{out}, in or around the recordings {path}",
            "a place apart from them",
            "Name another place; recordings are never written to, and nothing was removed.",
        )


def check_folder(out: Path, mark: str, what: str) -> None:
    """Refuse an output folder whose content would be lost.

    Args:
        out: The folder to write.
        mark: File by which an earlier output is known, which is replaced.
        what: What an output is called, one word.

    Raises:
        BadInputError: Not a folder, or one that holds something else.
    """
    try:
        if out.is_symlink() or (out.exists() and not out.is_dir()):
            _refuse(
                f"{out}, not a folder",
                f"a new folder, or that of an earlier {what}",
                "Name another folder.",
            )
        if out.is_dir() and any(out.iterdir()) and not (out / mark).is_file():
            _refuse(
                f"{out}, which holds something that is no {what}",
                f"a new folder, or that of an earlier {what}, which is replaced",
                "Name another folder; nothing was removed.",
            )
    except OSError as error:
        refuse_unreadable(out, error)


def refuse_dataset(path: Path) -> NoReturn:
    """Raise the error of a dataset that somebody would ingest again."""
    raise ConfigError(
        where=str(path),
        found="a dataset already",
        expected="recordings",
        action="Use it as it is, for instance with `genpolicy audit`.",
    )


def check_file(out: Path, *, force: bool) -> None:
    """Refuse an output file that is there already, unless it may be replaced.

    Raises:
        ConfigError: It is there, or it is a folder.
    """
    try:
        there, folder = out.exists(), out.is_dir()
    except OSError as error:
        refuse_unreadable(out, error)
    if folder or (there and not force):
        action = "Name another file" + ("." if folder else ", or give --force.")
        raise ConfigError(
            where=str(out),
            found="a folder" if folder else "there already",
            expected="a new file: somebody may have corrected the old one",
            action=action,
        )


def check_writable(path: Path, out: Path, layout: str) -> None:
    """Refuse an output where nothing can be written, or that has no room for the numbers.

    As much is asked for as the recordings hold, at most 4 GiB; nothing for a dataset, which is
    used as it lies.

    Raises:
        BadInputError: No permission, or too little free space.
    """
    try:
        place = next(p for p in out.resolve().parents if p.exists())
        if not place.is_dir():
            _refuse(f"{out}, below the file {place.name}", "a place in folders", "Check the path.")
        # What lies there is replaced, so it must be writable itself.
        for folder in (place, out) if out.is_dir() else (place,):
            if not os.access(folder, os.W_OK | os.X_OK):
                _refuse(f"{out}, where you may not write", "a writable place", "Name another one.")
        needed = 0 if layout == DATASET else _size(path, MOST_ROOM_BYTES)
        free = shutil.disk_usage(place).free
    except OSError as error:
        refuse_unreadable(out, error)
    if not free >= needed:
        _refuse(
            f"{out}, with {free / MIB:,.0f} MiB free",
            f"{needed / MIB:,.0f} MiB, as much as the recordings hold or 4 GiB",
            "Free space, or name another place.",
        )


def _size(path: Path, most: int) -> int:
    """Bytes of the recordings, videos and pictures beside them left out; counted up to `most`."""
    if not path.is_dir():
        return min(path.stat().st_size, most)
    total = 0
    for here, _, files in os.walk(path):
        for name in files:
            if named_layout(name) is not None:
                total += (Path(here) / name).lstat().st_size
            if total >= most:
                return most
    return total


def _refuse(found: str, expected: str, action: str) -> NoReturn:
    raise BadInputError(where="--out", found=found, expected=expected, action=action)
