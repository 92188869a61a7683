"""Signatures of people under a trial card: a DSSE envelope, Ed25519, an allow-list.

The signed payload is an in-toto style statement whose subjects are the whole hash chain: the
reports of gates A to D, the draft card and the candidate's checkpoint. A changed byte upstream
changes the statement, and the signatures no longer fit. This module signs only with a private
key that a person hands to it; it makes and keeps none.
"""

from dataclasses import dataclass
from pathlib import Path

from cryptography.exceptions import UnsupportedAlgorithm
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from cryptography.hazmat.primitives.serialization import load_pem_private_key
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
from gates.card.envelope_file import dsse_envelope, parse_envelope, refused
from gates.card.people import (
    ALLOW_LIST,
    BE_AT_THE_STOP,
    BE_INDEPENDENT,
    BE_LISTED,
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
from genpolicy.integrity.atomic import write_bytes
from genpolicy.integrity.documents import canonical_json, parse_json
from genpolicy.integrity.hashing import sha256_bytes_of, sha256_file

STATEMENT_TYPE = "urn:genpolicy:statement:1"
PREDICATE_TYPE = "urn:genpolicy:trial-card:1"
CARDS = "cards"
FILL = "Fill the current draft: `genpolicy card fill --out completed.json`; then have all sign it."
PEM_FILE = "Give the file that `genpolicy card keygen` wrote to its owner."
RETIRE = f"move it to a subfolder of {CARDS}/"


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
    payload, signatures = parse_envelope(data, where)
    card = _card_of(payload, where)
    _check_fixed(root, card, where)
    if payload != statement(root, card):
        raise refused(
            where,
            "a payload that names other bytes than lie here",
            "this hash chain",
            f"What it was signed for has changed: {RETIRE}. {FILL}",
        )
    envelope = dsse_envelope(payload, signatures, where)
    by_id = {person.key.keyid: person for person in allowed.people}
    unknown = [keyid for keyid in envelope.signatures if keyid not in by_id]
    if unknown:
        raise refused(
            where,
            f"signed by the unknown key {unknown[0][:12]}…",
            "listed keys only",
            f"Have the entry of that key committed to {ALLOW_LIST} if it belongs there. Else "
            f"{RETIRE}, and have all sign the completed card again.",
        )
    signers = tuple(by_id[keyid] for keyid in envelope.signatures)
    try:
        envelope.verify([person.key for person in signers], len(signers))
    except VerificationError as error:
        raise refused(
            where,
            "a signature that does not verify",
            "valid signatures only",
            f"One bad signature voids all: {RETIRE}, and have all sign the completed card again.",
        ) from error
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
    allowed, person, key = _signer(root, key_file, reviewer)
    where = card_file.name
    data = sha256_bytes_of(card_file, keep=True)[1]
    signatures: list[dict[str, str]] = []
    if card_file.name.endswith(".dsse.json"):
        card = open_envelope(root, data, where=where, allowed=allowed).card
        payload, signatures = parse_envelope(data, where)
    else:
        card = read_card(data, where=where)
        _check_fixed(root, card, where)
        payload = statement(root, card)
    _check_signable(card, person, allowed, where)
    target = root / envelope_path(card.name)
    if target.exists():
        signatures = _with_those_of(root, target, payload, signatures, allowed)
    if person.key.keyid in {entry["keyid"] for entry in signatures}:
        raise refused(
            target.name,
            f"signed by {person.id} already",
            "one signature of each person",
            "There is nothing more for this person to do; the others sign.",
        )
    envelope = dsse_envelope(payload, signatures, where)
    envelope.sign(CryptoSigner(key))
    write_bytes(target, canonical_json(envelope.to_dict()))
    return target


def require_no_rehearsal(root: Path) -> None:
    """Refuse a ladder of which no card can ever be signed.

    Raises:
        ConfigError: It is a rehearsal, or `params.yaml` is malformed.
    """
    if is_rehearsal(read_params(root)):
        raise refused(
            PARAMS_FILE,
            "a rehearsal",
            "a ladder whose limits protect people",
            "Sign the card of a ladder without `rehearsal: true`; of a rehearsal none is signed.",
        )


def _signer(
    root: Path, key_file: Path, reviewer: str
) -> tuple[AllowList, Person, Ed25519PrivateKey]:
    """Who may sign, who is about to, and with which key; refused before any card is read."""
    require_no_rehearsal(root)
    if read_plan(root) is None:
        raise refused(
            PREREGISTRATION,
            "missing or malformed",
            "a plan committed before the evidence",
            "Write it with `genpolicy gates preregister`, commit it, and measure again: "
            "`dvc repro`. A plan counts for evidence that came after it.",
        )
    allowed = load_allow_list(root)
    person = allowed.find(reviewer)
    if person is None:
        raise refused(ALLOW_LIST, f"without {reviewer!r}", "the id of a listed person", BE_LISTED)
    key = _private_key(key_file)
    if SSlibKey.from_crypto(key.public_key()).keyid != person.key.keyid:
        raise refused(
            "the private key",
            "another key",
            f"the key that {ALLOW_LIST} lists for {person.id}",
            "Sign with the private key of that entry. Who has lost it makes another with "
            "`genpolicy card keygen`, and has the entry changed in review.",
        )
    return allowed, person, key


def _with_those_of(
    root: Path, target: Path, payload: bytes, signatures: list[dict[str, str]], allowed: AllowList
) -> list[dict[str, str]]:
    """The signatures that lie there under this very card, verified, and those that are brought."""
    data = sha256_bytes_of(target, keep=True)[1]
    there, found = parse_envelope(data, target.name)
    if there != payload:
        raise refused(
            target.name,
            "another card of this name",
            "the signatures of one card",
            f"Is that the card that is meant, sign it: `--card {CARDS}/{target.name}`. Is it this "
            f"one, move the other to a subfolder of {CARDS}/ first; all sign again. Filling a "
            "draft twice gives two cards: fill it once, and hand that file on.",
        )
    open_envelope(root, data, where=target.name, allowed=allowed)
    known = {entry["keyid"] for entry in found}
    return [*found, *(entry for entry in signatures if entry["keyid"] not in known)]


def independence(signed: SignedCard, allowed: AllowList) -> tuple[bool | None, str]:
    """Whether the named reviewer signed, no signer is an author, and another stands at the stop.

    None where that reviewer has only still to sign: nobody else reviewed in their place.
    """
    card = signed.card
    why = dependence(card.reviewer, card.authors, signed.signers, allowed)
    if why := why or spotting(card.spotter, card.reviewer, card.authors, allowed):
        return False, why
    names = [person.id for person in signed.signers if person.role == REVIEWER]
    if card.reviewer not in names:
        named = allowed.find(card.reviewer)
        known = named is not None and named.role == REVIEWER and not names
        return None if known else False, f"{card.reviewer}, whom the card names, did not review it"
    made = f"candidate by {', '.join(card.authors)}"
    return True, f"reviewed by {card.reviewer}, {made}, {card.spotter} stands at the stop"


def envelope_path(name: str) -> str:
    """Path of the signed card of that name, relative to the repository."""
    return f"{CARDS}/{name}.dsse.json"


def conflicting_cards(root: Path, name: str) -> list[str]:
    """Other envelopes in `cards/` beside that of `name`; retired cards lie in a subfolder."""
    own = f"{name}.dsse.json"
    return sorted(p.name for p in (root / CARDS).glob("*.dsse.json") if p.name != own)


def _check_signable(card: TrialCard, person: Person, allowed: AllowList, where: str) -> None:
    missing = missing_fields(card)
    if missing:
        raise refused(
            where, f"incomplete ({', '.join(missing)})", "every field filled by a person", FILL
        )
    if person.role == REVIEWER and person.id != card.reviewer:
        raise refused(
            where,
            f"naming the reviewer {card.reviewer!r}",
            f"{person.id!r}",
            f"Have {card.reviewer} sign, or fill the draft again with {person.id} as reviewer.",
        )
    why = dependence(card.reviewer, card.authors, [person], allowed)
    if why:
        raise refused(
            where,
            why,
            "people who did not make the candidate",
            BE_INDEPENDENT,
        )
    if why := spotting(card.spotter, card.reviewer, card.authors, allowed):
        raise refused(
            f"{where}: spotter",
            why,
            "somebody else who may stop the trial",
            f"Fill the draft again. {BE_AT_THE_STOP}",
        )


def _check_fixed(root: Path, card: TrialCard, where: str) -> None:
    draft = read_draft(root)
    for name in FIXED:
        if getattr(card, name) != getattr(draft, name):
            raise refused(
                f"{where}: {name}",
                "another value",
                f"that of {draft_path(root).name}",
                f"What the draft fixes, nobody fills in. {FILL}",
            )
    lacking = left_out(draft.caveats, card)
    if lacking:
        raise refused(
            f"{where}: caveats",
            f"without {lacking[0][:60]!r}",
            f"all {len(draft.caveats)} of {draft_path(root).name}; more may be added",
            f"Put each back, word for word; or begin again. {FILL}",
        )


def _card_of(payload: bytes, where: str) -> TrialCard:
    document = parse_json(payload, where=f"{where}: payload")
    predicate = document.get("predicate") if isinstance(document, dict) else None
    return parse_section(TrialCard, predicate, where=f"{where}: predicate")


def _private_key(path: Path) -> Ed25519PrivateKey:
    try:
        key = load_pem_private_key(path.read_bytes(), password=None)
    except (OSError, ValueError, TypeError, UnsupportedAlgorithm) as error:
        raise refused(
            "the private key", "not readable", "a PEM file without password", PEM_FILE
        ) from error
    if not isinstance(key, Ed25519PrivateKey):
        raise refused("the private key", type(key).__name__, "an Ed25519 key", PEM_FILE)
    return key
