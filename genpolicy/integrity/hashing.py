"""SHA-256 of bytes, files and folders: the hash that names every artifact."""

import hashlib
import os
import stat
from pathlib import Path

from genpolicy.errors import IntegrityError

CHUNK_BYTES = 1 << 20


def sha256_bytes(data: bytes) -> str:
    """Hex SHA-256 of `data`."""
    return hashlib.sha256(data).hexdigest()


def sha256_file(path: Path) -> str:
    """Hex SHA-256 of a regular file, read without following a symlink.

    Raises:
        IntegrityError: The path is missing, a symlink or not a regular file.
    """
    return sha256_bytes_of(path, keep=False)[0]


def read_verified(path: Path, *, sha256: str, named_by: str) -> bytes:
    """Bytes of a file whose hash must be `sha256`; the bytes hashed are the bytes returned.

    Args:
        path: File to read.
        sha256: Hex digest that the bytes must have.
        named_by: The document that names this digest, for the error text.

    Raises:
        IntegrityError: Missing, not a regular file, or other bytes.
    """
    found, data = sha256_bytes_of(path, keep=True)
    if found != sha256:
        raise IntegrityError(
            where=str(path),
            found=f"a file with sha256 {found[:16]}…",
            expected=f"{sha256[:16]}… from {named_by}",
            action="Re-run the stage that writes it (`dvc repro`), or restore the original bytes.",
        )
    return data


def sha256_bytes_of(path: Path, *, keep: bool) -> tuple[str, bytes]:
    """Digest of a regular file and, if `keep`, its bytes (else empty), from one descriptor.

    Raises:
        IntegrityError: The path is missing, a symlink or not a regular file.
    """
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
    except OSError as error:
        raise IntegrityError(
            where=str(path),
            found=f"not readable ({error.strerror})",
            expected="a regular file, not a link",
            action="Re-run the stage that writes it (`dvc repro`).",
        ) from error
    if not _is_regular(descriptor):
        os.close(descriptor)
        raise IntegrityError(
            where=str(path),
            found="a folder or a device",
            expected="a regular file",
            action="Re-run the stage that writes it (`dvc repro`).",
        )
    digest = hashlib.sha256()
    kept = bytearray()
    with os.fdopen(descriptor, "rb") as stream:
        while block := stream.read(CHUNK_BYTES):
            digest.update(block)
            if keep:
                kept += block
    return digest.hexdigest(), bytes(kept)


def sha256_tree(folder: Path) -> dict[str, str]:
    """Digest of every regular file below `folder`, by POSIX path relative to it, sorted.

    Raises:
        IntegrityError: The folder is missing, or holds a symlink.
    """
    if not folder.is_dir():
        raise IntegrityError(
            where=str(folder),
            found="missing",
            expected="a folder of artifacts",
            action="Run the stage that writes it (`dvc repro`).",
        )
    names = sorted(path for path in folder.rglob("*") if path.is_symlink() or path.is_file())
    return {path.relative_to(folder).as_posix(): sha256_file(path) for path in names}


def _is_regular(descriptor: int) -> bool:
    return stat.S_ISREG(os.fstat(descriptor).st_mode)
