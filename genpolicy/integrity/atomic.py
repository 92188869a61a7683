"""Writes that are whole or absent: no reader ever sees half a file or half a folder."""

import contextlib
import os
import shutil
from collections.abc import Iterator
from pathlib import Path

from genpolicy.errors import BadInputError


def write_bytes(path: Path, data: bytes) -> None:
    """Write a file so that a crash leaves the old bytes or the new ones.

    Raises:
        BadInputError: The place cannot be written (read-only, full, a folder in the way).
    """
    temporary = path.with_name(f".{path.name}.tmp.{os.getpid()}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with temporary.open("wb") as stream:
            stream.write(data)
            stream.flush()
            os.fsync(stream.fileno())
        os.replace(temporary, path)
        _sync_folder(path.parent)
    except OSError as error:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)
        raise _unwritable(path, error) from error


@contextlib.contextmanager
def output_folder(path: Path) -> Iterator[Path]:
    """A folder that appears whole, when the block ends well, or not at all.

    The old folder is removed first: what a stage is about to replace is no longer true. The
    block writes into a temporary sibling, which is renamed at the end.

    Yields:
        The temporary folder to write into.

    Raises:
        BadInputError: The place cannot be written (read-only, full).
    """
    temporary = path.with_name(f".{path.name}.tmp.{os.getpid()}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        for stale in path.parent.glob(f".{path.name}.tmp.*"):
            shutil.rmtree(stale)
        if path.exists():
            shutil.rmtree(path)
        temporary.mkdir()
    except OSError as error:
        raise _unwritable(path, error) from error
    try:
        yield temporary
        for file in temporary.rglob("*"):
            if file.is_file():
                with file.open("rb") as stream:
                    os.fsync(stream.fileno())
        os.replace(temporary, path)
        _sync_folder(path.parent)
    except OSError as error:
        shutil.rmtree(temporary, ignore_errors=True)
        raise _unwritable(path, error) from error
    except BaseException:
        shutil.rmtree(temporary, ignore_errors=True)
        raise


def _sync_folder(folder: Path) -> None:
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _unwritable(path: Path, error: OSError) -> BadInputError:
    return BadInputError(
        where=str(path),
        found=f"not writable ({error.strerror or error})",
        expected="a writable place with free space",
        action="Free space or fix the permissions, then run the stage again.",
    )
