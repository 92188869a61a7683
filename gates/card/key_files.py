"""A person's own key, made on the person's machine; nothing here keeps or sends it."""

import os
from pathlib import Path

from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

from genpolicy.errors import BadInputError

OWNER_ONLY = 0o600


def make_key(path: Path, *, root: Path) -> str:
    """Write a new Ed25519 private key, readable by its owner only.

    Args:
        path: File to write, outside the workspace: what lies in it is committed one day.
        root: The workspace.

    Returns:
        The public key, 64 hex digits.

    Raises:
        BadInputError: Inside the workspace, something is there already, or the place cannot be
            written.
    """
    if path.resolve().is_relative_to(root.resolve()):
        raise _refused(path, "inside the workspace", "a place that nobody commits")
    key = Ed25519PrivateKey.generate()
    text = key.private_bytes(
        serialization.Encoding.PEM,
        serialization.PrivateFormat.PKCS8,
        serialization.NoEncryption(),
    )
    try:
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW, OWNER_ONLY)
    except FileExistsError as error:
        raise _refused(path, "there already", "a new file; no key is ever replaced") from error
    except OSError as error:
        raise _refused(path, f"not writable ({error.strerror})", "a folder of yours") from error
    with os.fdopen(descriptor, "wb") as stream:
        stream.write(text)
    return key.public_key().public_bytes_raw().hex()


def _refused(path: Path, found: str, expected: str) -> BadInputError:
    return BadInputError(
        where=str(path), found=found, expected=expected, action="Name another file."
    )
