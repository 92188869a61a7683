"""What lies there of a card: the draft, and the envelope that people signed."""

from dataclasses import dataclass
from pathlib import Path

from gates.card.card import DRAFT_PATH, TrialCard, read_card
from gates.card.people import load_allow_list
from gates.card.signing import (
    CARDS,
    SignedCard,
    conflicting_cards,
    envelope_path,
    open_envelope,
)
from gates.preregistration import NONE, read_plan
from gates.protection import REHEARSED, is_rehearsal
from gates.settings import read_params
from genpolicy.errors import BadInputError, GenpolicyError
from genpolicy.integrity.hashing import sha256_bytes_of


@dataclass(frozen=True)
class Papers:
    """The draft and the envelope as they lie there.

    Attributes:
        draft: The draft card, if it can be read.
        present: Whether an envelope lies in `cards/`.
        signed: The verified card; None if there is none or it is refused.
        refusal: Why the envelope is refused; empty if it is not.
    """

    draft: TrialCard | None
    present: bool
    signed: SignedCard | None
    refusal: str


def examine(root: Path, name: str) -> Papers:
    """Read the draft and verify the envelope of that name, if there is one."""
    draft = _draft(root)
    path = root / envelope_path(name)
    present = path.exists() or path.is_symlink()
    signed, refusal = None, ""
    if present:
        try:
            others = conflicting_cards(root, name)
            if others:
                raise BadInputError(
                    where=CARDS,
                    found=f"holding {', '.join(others)} as well",
                    expected="one card",
                    action="Retire the others.",
                )
            data = sha256_bytes_of(path, keep=True)[1]
            allowed = load_allow_list(root)
            signed = open_envelope(root, data, where=path.name, allowed=allowed)
            if signed.card.name != name:
                signed, refusal = None, "the card has another name than its file"
            if read_plan(root) is None:
                signed, refusal = None, NONE
            if is_rehearsal(read_params(root)):
                signed, refusal = None, REHEARSED
        except GenpolicyError as error:
            signed, refusal = None, str(error)
    return Papers(draft, present, signed, refusal)


def _draft(root: Path) -> TrialCard | None:
    try:
        data = sha256_bytes_of(root / DRAFT_PATH, keep=True)[1]
        return read_card(data, where=DRAFT_PATH)
    except BadInputError:
        return None
