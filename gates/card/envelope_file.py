"""The file of a signed card: an envelope of DSSE, read strictly and by its parts.

Nothing is verified here: what a signature is worth, and over which bytes, is asked elsewhere.
"""

import base64
from typing import Any

from securesystemslib.dsse import Envelope as DsseEnvelope

from genpolicy.errors import BadInputError, IntegrityError
from genpolicy.integrity.documents import parse_json

PAYLOAD_TYPE = "application/vnd.genpolicy.trial-card+json"
AS_WRITTEN = "Take the file as `genpolicy card sign` wrote it; nothing in it is edited by hand."


def parse_envelope(data: bytes, where: str) -> tuple[bytes, list[dict[str, str]]]:
    """Payload and signatures of an envelope, as its file has them.

    Raises:
        BadInputError: Another document, payload type or form.
    """
    document = parse_json(data, where=where)
    if not isinstance(document, dict) or set(document) != {"payload", "payloadType", "signatures"}:
        raise refused(where, "another document", "payload, payloadType and signatures", AS_WRITTEN)
    if document["payloadType"] != PAYLOAD_TYPE:
        raise refused(
            f"{where}: payloadType", repr(document["payloadType"])[:60], PAYLOAD_TYPE, AS_WRITTEN
        )
    signatures = document["signatures"]
    if not isinstance(signatures, list) or not signatures:
        raise refused(f"{where}: signatures", "empty", "at least one signature", AS_WRITTEN)
    for entry in signatures:
        if not isinstance(entry, dict) or set(entry) != {"keyid", "sig"}:
            raise refused(f"{where}: signatures", "another form", "keyid and sig", AS_WRITTEN)
        if not isinstance(entry["keyid"], str):
            raise refused(f"{where}: keyid", repr(entry["keyid"])[:60], "a text", AS_WRITTEN)
        _decoded(entry["sig"], f"{where}: sig")
    return _decoded(document["payload"], f"{where}: payload"), signatures


def _decoded(text: Any, where: str) -> bytes:
    try:
        if not isinstance(text, str):
            raise ValueError("no text")
        return base64.b64decode(text, validate=True)
    except ValueError as error:
        raise refused(where, "not base64", "whole base64 text", AS_WRITTEN) from error


def dsse_envelope(payload: bytes, signatures: list[dict[str, str]], where: str) -> DsseEnvelope:
    """The envelope of a payload and its signatures.

    Raises:
        BadInputError: Two signatures by one key.
    """
    try:
        return DsseEnvelope.from_dict(
            {
                "payload": base64.b64encode(payload).decode(),
                "payloadType": PAYLOAD_TYPE,
                "signatures": [dict(entry) for entry in signatures],
            }
        )
    except ValueError as error:
        raise refused(
            f"{where}: signatures", "two of one key", "one per key", AS_WRITTEN
        ) from error


def refused(where: str, found: str, expected: str, action: str) -> BadInputError:
    """The refusal of a card or of its signing, with what to do about it."""
    return IntegrityError(where=where, found=found, expected=expected, action=action)
