"""The archive around a bundle: a zip file with the index, the statements, and blobs by hash.

Writing is whole or nothing. Reading believes nothing: an entry that the index does not name, a
byte more than it says, another hash, a link or a path that leads out is refused, and nothing is
unpacked anywhere but below the folder that is given.
"""

import contextlib
import hashlib
import os
import shutil
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import IO

from gates.package.index import BundledFile, BundleIndex, parse_index
from gates.package.statements import statement_path
from gates.report import Gate
from genpolicy.errors import BadInputError, IntegrityError
from genpolicy.integrity.hashing import sha256_bytes, sha256_bytes_of

INDEX_NAME = "index.json"
WRITTEN = (1980, 1, 1, 0, 0, 0)
"""Time of every entry: the same run gives the same archive."""
INDEX_BYTES = 64 << 20
CHUNK_BYTES = 1 << 20
MARGIN_BYTES = 64 << 20
"""Free space that must be left where a bundle is unpacked."""
BROKEN = (
    zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError, ValueError,
)  # fmt: skip
"""What zip and zlib say of broken bytes."""


def write_archive(
    path: Path, index: BundleIndex, statements: Mapping[str, bytes], *, root: Path
) -> None:
    """Write a bundle, or nothing.

    Args:
        path: Of the archive; one that lies there is replaced.
        index: What is in it.
        statements: Bytes by path in the archive.
        root: Workspace that the files are read from, once more by hash.

    Raises:
        IntegrityError: A file is another one than the index says: something writes here.
        BadInputError: The place cannot be written, or is a folder.
    """
    if not path.name or path.is_dir():
        raise BadInputError(
            where=str(path),
            found="a folder",
            expected="the name of a file",
            action="Name the file to write: `--out flow.zip`.",
        )
    temporary = path.with_name(f".{path.name}.tmp.{os.getpid()}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED) as archive:
            _put(archive, INDEX_NAME, index.data())
            for name, data in sorted(statements.items()):
                _put(archive, name, data)
            written: set[str] = set()
            for name, file in sorted(index.files.items()):
                if file.sha256 in written:
                    continue
                digest, data = sha256_bytes_of(root / name, keep=True)
                if digest != file.sha256:
                    raise IntegrityError(
                        where=name,
                        found="changed while it was packaged",
                        expected="the bytes that were judged",
                        action="Package again, with nothing else writing here.",
                    )
                _put(archive, blob_name(digest), data)
                written.add(digest)
        os.replace(temporary, path)
    except OSError as error:
        raise BadInputError(
            where=str(path),
            found=f"not writable ({error.strerror or error})",
            expected="a writable place with free space",
            action="Free space, or choose another file by `--out`.",
        ) from error
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink()


def blob_name(sha256: str) -> str:
    """Where a file's bytes lie in the archive."""
    return f"blobs/{sha256}"


def read_index(path: Path) -> BundleIndex:
    """The index of a bundle.

    Raises:
        BadInputError: There is no such file, or it cannot be read.
        IntegrityError: It is no archive of a bundle.
    """
    with _opened(path) as archive:
        return parse_index(_bounded(archive, INDEX_NAME, path), where=f"{path}: {INDEX_NAME}")


def unpack(path: Path, folder: Path) -> tuple[BundleIndex, dict[Gate, bytes]]:
    """Lay out the files of a bundle as they lay in the workspace, each held against its hash.

    Args:
        path: Of the archive.
        folder: An empty folder.

    Returns:
        The index, and the statements by gate, each held against its hash too.

    Raises:
        BadInputError: There is no such file, it cannot be read, or there is no space.
        IntegrityError: A byte is not what the index says, or there is more or less than it says.
    """
    with _opened(path) as archive:
        index = parse_index(_bounded(archive, INDEX_NAME, path), where=f"{path}: {INDEX_NAME}")
        _require_names(archive, index, path)
        _require_space(index, folder)
        for name, file in sorted(index.files.items()):
            target = folder / name
            target.parent.mkdir(parents=True, exist_ok=True)
            with target.open("xb") as stream:
                _copy(archive, file, stream, name)
            target.chmod(0o755 if file.executable else 0o644)
        statements: dict[Gate, bytes] = {}
        for gate, digest in index.statements.items():
            data = _bounded(archive, statement_path(gate), path)
            if sha256_bytes(data) != digest:
                raise _other(f"{path}: {statement_path(gate)}", "other bytes", "those of its index")
            statements[gate] = data
    return index, statements


def _put(archive: zipfile.ZipFile, name: str, data: bytes) -> None:
    entry = zipfile.ZipInfo(name, WRITTEN)
    entry.compress_type = zipfile.ZIP_DEFLATED
    archive.writestr(entry, data)


@contextlib.contextmanager
def _opened(path: Path) -> Iterator[zipfile.ZipFile]:
    """The archive; broken bytes become an error of ours."""
    if not path.is_file():
        raise BadInputError(
            where=str(path),
            found="no file",
            expected="a bundle that `genpolicy package` wrote",
            action="Give the path of the bundle.",
        )
    try:
        with zipfile.ZipFile(path) as archive:
            kinds = {entry.compress_type for entry in archive.infolist()}
            if not kinds <= {zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED}:
                raise _other(str(path), "an entry packed in another way", "deflated entries")
            yield archive
    except BROKEN as error:
        raise _other(str(path), f"broken ({error})", "a whole archive") from error
    except KeyError as error:
        raise _other(str(path), f"without an entry ({error.args[0]})", "all of them") from error
    except OSError as error:
        raise BadInputError(
            where=str(error.filename or path),
            found=f"not readable or writable ({error.strerror or error})",
            expected="a bundle, and space to unpack it",
            action="Free space, or fix the permissions.",
        ) from error


def _bounded(archive: zipfile.ZipFile, name: str, path: Path) -> bytes:
    with archive.open(name) as stream:
        data = stream.read(INDEX_BYTES + 1)
    if len(data) > INDEX_BYTES:
        raise _other(f"{path}: {name}", "too large", f"at most {INDEX_BYTES} bytes")
    return data


def _require_names(archive: zipfile.ZipFile, index: BundleIndex, path: Path) -> None:
    """Each entry that the index names once, and no other."""
    expected = {INDEX_NAME, *(statement_path(gate) for gate in index.statements)}
    expected |= {blob_name(file.sha256) for file in index.files.values()}
    found = archive.namelist()
    if len(found) != len(set(found)):
        raise _other(str(path), "two entries of one name", "each entry once")
    beyond = sorted(set(found) ^ expected)
    if beyond:
        raise _other(str(path), f"without or beyond {beyond[0]!r:.90}", "what its index names")


def _require_space(index: BundleIndex, folder: Path) -> None:
    needed = sum(file.size for file in index.files.values())
    free = shutil.disk_usage(folder).free
    if needed + MARGIN_BYTES > free:
        raise BadInputError(
            where=str(folder),
            found=f"{free >> 20} MiB free",
            expected=f"room for the bundle's {needed >> 20} MiB",
            action="Set TMPDIR to a folder with more space.",
        )


def _copy(archive: zipfile.ZipFile, file: BundledFile, target: IO[bytes], name: str) -> None:
    """Copy an entry, never more than it says of itself."""
    digest, count = hashlib.sha256(), 0
    with archive.open(blob_name(file.sha256)) as stream:
        while data := stream.read(CHUNK_BYTES):
            count += len(data)
            if count > file.size:
                break
            digest.update(data)
            target.write(data)
    if count != file.size or digest.hexdigest() != file.sha256:
        raise _other(
            name, "other bytes than its index says", f"{file.size} bytes, {file.sha256[:12]}…"
        )


def _other(where: str, found: str, expected: str) -> IntegrityError:
    return IntegrityError(
        where=where,
        found=found,
        expected=expected,
        action="Ask for the bundle again, and compare its address.",
    )
