"""Envelopes over the statement of a card, by the keys that lie in a `signed` base."""

import base64
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from cryptography.hazmat.primitives.serialization import load_pem_private_key
from securesystemslib.signer import SSlibKey  # type: ignore[attr-defined]

from gates.card.envelope_file import PAYLOAD_TYPE
from genpolicy.integrity.documents import canonical_json

SIGNERS = ("rita", "mo", "pia", "col", "sam")
KEYS = "keys"


def statement_of(workspace: Path) -> dict[str, Any]:
    """What the people signed."""
    payload = json.loads(_envelope(workspace).read_bytes())["payload"]
    statement: dict[str, Any] = json.loads(base64.b64decode(payload))
    return statement


def replace_payload(workspace: Path, statement: dict[str, Any]) -> None:
    """Another statement under the old signatures."""
    path = _envelope(workspace)
    document = json.loads(path.read_bytes())
    document["payload"] = base64.b64encode(canonical_json(statement)).decode()
    path.write_bytes(canonical_json(document))


def sign_statement(workspace: Path, statement: dict[str, Any], signers: Sequence[str]) -> None:
    """Sign a statement with real keys, past every check of `genpolicy card sign`."""
    data = canonical_json(statement)
    sealed = b"DSSEv1 %d %b %d %b" % (len(PAYLOAD_TYPE), PAYLOAD_TYPE.encode(), len(data), data)
    signatures = []
    for name in signers:
        key = load_pem_private_key((workspace / KEYS / name).read_bytes(), password=None)
        assert isinstance(key, Ed25519PrivateKey)
        signatures.append({
            "keyid": SSlibKey.from_crypto(key.public_key()).keyid,
            "sig": base64.b64encode(key.sign(sealed)).decode(),
        })  # fmt: skip
    document = {
        "payload": base64.b64encode(data).decode(),
        "payloadType": PAYLOAD_TYPE,
        "signatures": signatures,
    }
    _envelope(workspace).write_bytes(canonical_json(document))


def _envelope(workspace: Path) -> Path:
    (path,) = sorted((workspace / "cards").glob("*.dsse.json"))
    return path
