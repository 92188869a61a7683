"""Writes that are whole or absent: no reader ever sees half a file or half a folder."""

import contextlib
import errno
import fcntl
import glob
import os
import shutil
from collections.abc import Iterator
from pathlib import Path

from genpolicy.errors import BadInputError

WRITE_ERRORS = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS)


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
    block writes into a temporary sibling, which is renamed at the end. One writer at a time: a
    lock beside the folder is held until then, and freed by the system if the writer dies.

    Yields:
        The temporary folder to write into.

    Raises:
        BadInputError: The place cannot be written (read-only, full), or another process is
            writing it. An error of the block's own reading passes through unchanged.
    """
    temporary = path.with_name(f".{path.name}.tmp.{os.getpid()}")
    with _exclusive(path):
        try:
            for stale in path.parent.glob(f".{glob.escape(path.name)}.tmp.*"):
                _remove(stale)
            _remove(path)
            temporary.mkdir()
        except OSError as error:
            raise _unwritable(path, error) from error
        try:
            yield temporary
        except OSError as error:
            shutil.rmtree(temporary, ignore_errors=True)
            if _is_about_writing(error, temporary):
                raise _unwritable(path, error) from error
            raise
        except BaseException:
            shutil.rmtree(temporary, ignore_errors=True)
            raise
        try:
            _publish(temporary, path)
        except OSError as error:
            shutil.rmtree(temporary, ignore_errors=True)
            raise _unwritable(path, error) from error


def _publish(temporary: Path, path: Path) -> None:
    for file in temporary.rglob("*"):
        if file.is_file():
            with file.open("rb") as stream:
                os.fsync(stream.fileno())
    os.replace(temporary, path)
    _sync_folder(path.parent)


@contextlib.contextmanager
def _exclusive(path: Path) -> Iterator[None]:
    """Hold `.name.lock` beside `path`; it is removed at the end, by the holder only."""
    lock = path.with_name(f".{path.name}.lock")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        descriptor = _acquire(lock)
    except BlockingIOError as error:
        raise BadInputError(
            where=str(lock),
            found="held by another process that writes the same folder",
            expected="one writer at a time",
            action="Wait until it has finished, then run the stage again.",
        ) from error
    except OSError as error:
        raise _unwritable(path, error) from error
    try:
        yield
    finally:
        with contextlib.suppress(OSError):
            lock.unlink()
        os.close(descriptor)


def _acquire(lock: Path) -> int:
    """Descriptor of the locked file; tries again where the last holder has just removed it."""
    while True:
        descriptor = os.open(lock, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o644)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            with contextlib.suppress(FileNotFoundError):
                if os.path.samestat(os.fstat(descriptor), lock.stat()):
                    return descriptor
        except BaseException:
            os.close(descriptor)
            raise
        os.close(descriptor)


def _remove(path: Path) -> None:
    if path.is_symlink() or path.is_file():
        path.unlink()
    elif path.exists():
        shutil.rmtree(path)


def _is_about_writing(error: OSError, folder: Path) -> bool:
    """Whether the block failed at its output: no space, read-only, or a path below it."""
    if error.errno in WRITE_ERRORS:
        return True
    names = (error.filename, error.filename2)
    return any(isinstance(n, str) and Path(n).is_relative_to(folder) for n in names)


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
