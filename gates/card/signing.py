"""Signatures of people under a trial card: a DSSE envelope, Ed25519, an allow-list.

The signed payload is an in-toto style statement whose subjects are the whole hash chain: the
reports of gates A to D, the draft card and the candidate's checkpoint. A changed byte upstream
changes the statement, and the signatures no longer fit. This module signs only with a private
key that a person hands to it; it makes and keeps none.
"""

import base64
import datetime
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cryptography.exceptions import UnsupportedAlgorithm
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from cryptography.hazmat.primitives.serialization import load_pem_private_key
from securesystemslib.dsse import Envelope as DsseEnvelope
from securesystemslib.exceptions import VerificationError
from securesystemslib.signer import CryptoSigner, SSlibKey  # type: ignore[attr-defined]

from gates.card.card import (
    FIXED,
    TrialCard,
    draft_path,
    left_out,
    missing_fields,
    read_card,
)
from gates.card.people import (
    ALLOW_LIST,
    REVIEWER,
    AllowList,
    Person,
    dependence,
    load_allow_list,
    spotting,
)
from gates.preregistration import PREREGISTRATION, read_plan
from gates.protection import is_rehearsal
from gates.report import parse_section
from gates.settings import PARAMS_FILE, read_params
from genpolicy.errors import BadInputError, IntegrityError
from genpolicy.integrity.atomic import write_bytes
from genpolicy.integrity.documents import canonical_json, parse_json
from genpolicy.integrity.hashing import sha256_bytes_of, sha256_file

PAYLOAD_TYPE = "application/vnd.genpolicy.trial-card+json"
STATEMENT_TYPE = "urn:genpolicy:statement:1"
PREDICATE_TYPE = "urn:genpolicy:trial-card:1"
CARDS = "cards"


@dataclass(frozen=True)
class SignedCard:
    """A card whose signatures verified.

    Attributes:
        card: What was signed.
        signers: People whose signatures verified, all of them on the allow-list.
    """

    card: TrialCard
    signers: tuple[Person, ...]


def statement(root: Path, card: TrialCard) -> bytes:
    """The payload to be signed: the card, bound to the files that lie here now.

    Raises:
        IntegrityError: A file of the chain is missing.
    """
    paths = [f"reports/gate_{gate}.json" for gate in "abcd"]
    paths.append(draft_path(root).relative_to(root).as_posix())
    subject = [{"name": p, "digest": {"sha256": sha256_file(root / p)}} for p in paths]
    subject.append(
        {
            "name": f"checkpoint of {card.candidate}",
            "digest": {"sha256": card.candidate_checkpoint_sha256},
        }
    )
    return canonical_json(
        {
            "_type": STATEMENT_TYPE,
            "predicateType": PREDICATE_TYPE,
            "subject": subject,
            "predicate": card.model_dump(mode="json"),
        }
    )


def open_envelope(root: Path, data: bytes, *, where: str, allowed: AllowList) -> SignedCard:
    """Verify an envelope against the allow-list and the files that lie here now.

    Every signature must be by a listed key and must verify; one bad signature voids all.

    Raises:
        BadInputError: Malformed, another payload type, unknown key, bad signature, or a payload
            that is not the statement of this chain.
    """
    payload, signatures = _parse_envelope(data, where)
    card = _card_of(payload, where)
    _check_fixed(root, card, where)
    if payload != statement(root, card):
        raise _bad(where, "a payload that names other bytes than lie here", "this hash chain")
    envelope = _dsse(payload, signatures, where)
    by_id = {person.key.keyid: person for person in allowed.people}
    unknown = [keyid for keyid in envelope.signatures if keyid not in by_id]
    if unknown:
        raise _bad(where, f"signed by the unknown key {unknown[0][:12]}…", "listed keys only")
    signers = tuple(by_id[keyid] for keyid in envelope.signatures)
    try:
        envelope.verify([person.key for person in signers], len(signers))
    except VerificationError as error:
        raise _bad(where, "a signature that does not verify", "valid signatures only") from error
    return SignedCard(card, signers)


def read_draft(root: Path) -> TrialCard:
    """The draft card.

    Raises:
        BadInputError: Missing or malformed.
    """
    data = sha256_bytes_of(draft_path(root), keep=True)[1]
    return read_card(data, where=draft_path(root).relative_to(root).as_posix())


def sign_card(root: Path, *, card_file: Path, key_file: Path, reviewer: str) -> Path:
    """Add one person's signature, by that person's own key.

    Args:
        root: Repository root.
        card_file: A completed card (JSON), or an envelope that others have signed.
        key_file: The person's private key, PEM, Ed25519.
        reviewer: The person's identifier on the allow-list.

    Returns:
        Path of the envelope, `cards/<name>.dsse.json`.

    Raises:
        BadInputError: This is a rehearsal, the person is not listed or signed already, the key is
            not theirs, the card is incomplete, changed, reviewed or owned by an author, or stands
            against another card of the same name.
    """
    if is_rehearsal(read_params(root)):
        raise _bad(PARAMS_FILE, "a rehearsal", "a ladder whose limits protect people")
    if read_plan(root) is None:
        raise _bad(PREREGISTRATION, "missing or malformed", "a plan committed before the evidence")
    allowed = load_allow_list(root)
    person = allowed.find(reviewer)
    if person is None:
        raise _bad(ALLOW_LIST, f"without {reviewer!r}", "the id of a listed person")
    key = _private_key(key_file)
    if SSlibKey.from_crypto(key.public_key()).keyid != person.key.keyid:
        raise _bad("the private key", "another key", f"the key that {ALLOW_LIST} lists for them")
    where = card_file.name
    data = sha256_bytes_of(card_file, keep=True)[1]
    signatures: list[dict[str, str]] = []
    if card_file.name.endswith(".dsse.json"):
        card = open_envelope(root, data, where=where, allowed=allowed).card
        payload, signatures = _parse_envelope(data, where)
        if person.key.keyid in {entry["keyid"] for entry in signatures}:
            raise _bad(where, f"signed by {person.id} already", "one signature of each person")
    else:
        card = read_card(data, where=where)
        _check_fixed(root, card, where)
        payload = statement(root, card)
    _check_signable(card, person, allowed, where)
    envelope = _dsse(payload, signatures, where)
    envelope.sign(CryptoSigner(key))
    target = root / CARDS / f"{card.name}.dsse.json"
    if target.exists() and _parse_envelope(target.read_bytes(), target.name)[0] != payload:
        raise _bad(target.name, "another card of this name", "one card; retire the other first")
    write_bytes(target, canonical_json(envelope.to_dict()))
    return target


def independence(signed: SignedCard, allowed: AllowList) -> tuple[bool, str]:
    """Whether the named reviewer signed, no signer is an author, and another stands at the stop."""
    card = signed.card
    names = [person.id for person in signed.signers if person.role == REVIEWER]
    if card.reviewer not in names:
        return False, "the reviewer named on the card did not sign"
    why = dependence(card.reviewer, card.authors, signed.signers, allowed)
    if why:
        return False, why
    if why := spotting(card.spotter, card.reviewer, card.authors, allowed):
        return False, why
    made = f"candidate by {', '.join(card.authors)}"
    return True, f"reviewed by {card.reviewer}, {made}, {card.spotter} stands at the stop"


def envelope_path(name: str) -> str:
    """Path of the signed card of that name, relative to the repository."""
    return f"{CARDS}/{name}.dsse.json"


def conflicting_cards(root: Path, name: str) -> list[str]:
    """Other envelopes in `cards/` beside that of `name`; retired cards lie in a subfolder."""
    own = f"{name}.dsse.json"
    return sorted(p.name for p in (root / CARDS).glob("*.dsse.json") if p.name != own)


def utc_today() -> datetime.date:
    """Today, UTC."""
    return datetime.datetime.now(datetime.UTC).date()


def _check_signable(card: TrialCard, person: Person, allowed: AllowList, where: str) -> None:
    missing = missing_fields(card)
    if missing:
        raise _bad(where, f"incomplete ({', '.join(missing)})", "every field filled by a person")
    if person.role == REVIEWER and person.id != card.reviewer:
        raise _bad(where, f"naming the reviewer {card.reviewer!r}", f"{person.id!r}")
    why = dependence(card.reviewer, card.authors, [person], allowed)
    if why:
        raise _bad(where, why, "people who did not make the candidate")
    if why := spotting(card.spotter, card.reviewer, card.authors, allowed):
        raise _bad(f"{where}: spotter", why, "somebody else who may stop the trial")


def _check_fixed(root: Path, card: TrialCard, where: str) -> None:
    draft = read_draft(root)
    for name in FIXED:
        if getattr(card, name) != getattr(draft, name):
            raise _bad(f"{where}: {name}", "another value", f"that of {draft_path(root).name}")
    lacking = left_out(draft.caveats, card)
    if lacking:
        text = f"all {len(draft.caveats)} of {draft_path(root).name}; more may be added"
        raise _bad(f"{where}: caveats", f"without {lacking[0][:60]!r}", text)


def _parse_envelope(data: bytes, where: str) -> tuple[bytes, list[dict[str, str]]]:
    document = parse_json(data, where=where)
    if not isinstance(document, dict) or set(document) != {"payload", "payloadType", "signatures"}:
        raise _bad(where, "another document", "payload, payloadType and signatures")
    if document["payloadType"] != PAYLOAD_TYPE:
        raise _bad(f"{where}: payloadType", repr(document["payloadType"])[:60], PAYLOAD_TYPE)
    signatures = document["signatures"]
    if not isinstance(signatures, list) or not signatures:
        raise _bad(f"{where}: signatures", "empty", "at least one signature")
    for entry in signatures:
        if not isinstance(entry, dict) or set(entry) != {"keyid", "sig"}:
            raise _bad(f"{where}: signatures", "another form", "keyid and sig")
        if not isinstance(entry["keyid"], str):
            raise _bad(f"{where}: keyid", repr(entry["keyid"])[:60], "a text")
        _decoded(entry["sig"], f"{where}: sig")
    return _decoded(document["payload"], f"{where}: payload"), signatures


def _decoded(text: Any, where: str) -> bytes:
    try:
        if not isinstance(text, str):
            raise ValueError("no text")
        return base64.b64decode(text, validate=True)
    except ValueError as error:
        raise _bad(where, "not base64", "whole base64 text") from error


def _card_of(payload: bytes, where: str) -> TrialCard:
    document = parse_json(payload, where=f"{where}: payload")
    predicate = document.get("predicate") if isinstance(document, dict) else None
    return parse_section(TrialCard, predicate, where=f"{where}: predicate")


def _dsse(payload: bytes, signatures: list[dict[str, str]], where: str) -> DsseEnvelope:
    try:
        return DsseEnvelope.from_dict(
            {
                "payload": base64.b64encode(payload).decode(),
                "payloadType": PAYLOAD_TYPE,
                "signatures": [dict(entry) for entry in signatures],
            }
        )
    except ValueError as error:
        raise _bad(f"{where}: signatures", "two of one key", "one per key") from error


def _private_key(path: Path) -> Ed25519PrivateKey:
    try:
        key = load_pem_private_key(path.read_bytes(), password=None)
    except (OSError, ValueError, TypeError, UnsupportedAlgorithm) as error:
        raise _bad("the private key", "not readable", "a PEM file without password") from error
    if not isinstance(key, Ed25519PrivateKey):
        raise _bad("the private key", type(key).__name__, "an Ed25519 key")
    return key


def _bad(where: str, found: str, expected: str) -> BadInputError:
    return IntegrityError(
        where=where,
        found=found,
        expected=expected,
        action="Have the card completed and signed again from the current draft.",
    )
