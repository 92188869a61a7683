"""Who may sign: the allow-list `reviewers.yaml`, and who is independent of whom.

A person is an identifier and a key of that list. Names are for reading, and decide nothing; since
the list is reviewed by eye, no two may read alike and none may hide how it is written.
"""

import itertools
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey
from pydantic import Field
from securesystemslib.signer import SSlibKey  # type: ignore[attr-defined]

from gates.card.keys import key_weakness
from gates.card.names import as_drawn, as_read, disguise
from gates.report import OWNERS, StrictModel, parse_section
from genpolicy.errors import ConfigError
from genpolicy.integrity.documents import read_yaml

ALLOW_LIST = "reviewers.yaml"
REVIEWER, AUTHOR, SPOTTER = "reviewer", "author", "spotter"
SIGNERS = (REVIEWER, *OWNERS)
"""Roles whose signatures a card needs, each of one person, in the order in which they are told."""
ROLES = (*SIGNERS, AUTHOR, SPOTTER)
BE_LISTED = (
    f"Give the id as {ALLOW_LIST} writes it. Who is not on it runs `genpolicy card keygen`, and "
    "has the entry that it prints committed there, in review."
)
BE_INDEPENDENT = (
    f"Have somebody review and own it who did not make the candidate. Who did stands in "
    f"`params.yaml: card.authors`, by an id of {ALLOW_LIST}."
)
BE_AT_THE_STOP = (
    f"Name an owner by the id on {ALLOW_LIST}, or somebody whose role is `spotter` there; who is "
    "not on it yet is entered in review."
)
"""What to do about somebody who cannot stand where a card names them."""
ID_FORM = r"^[a-z0-9][a-z0-9._-]{0,63}$"
PersonId = Annotated[str, Field(pattern=ID_FORM)]
"""ASCII, so that no two of them look alike by accident of spelling."""
Email = Annotated[str, Field(pattern=r"^[!-?A-~]+@[a-z0-9.-]+$")]


class Person(StrictModel):
    """One person, one role, one key.

    Attributes:
        id: Identifies the person, here and on the card.
        name: For reading.
        role: `reviewer`, one of the four owners, `author` (made the candidate; signs nothing), or
            `spotter` (may stand at the stop; nobody waits for a signature).
        public_key: Ed25519 public key, 64 hex digits.
        emails: Addresses under which the person commits.
    """

    id: PersonId
    name: str = Field(min_length=1)
    role: str = Field(pattern=f"^({'|'.join(ROLES)})$")
    public_key: str = Field(pattern=r"^[0-9a-f]{64}$")
    emails: tuple[Email, ...] = ()

    @property
    def mails(self) -> frozenset[str]:
        """The addresses as they are compared: git and entries write them in any case."""
        return frozenset(mail.casefold() for mail in self.emails)

    @property
    def key(self) -> SSlibKey:
        """The public key, with the identifier that its bytes give it."""
        return SSlibKey.from_crypto(
            Ed25519PublicKey.from_public_bytes(bytes.fromhex(self.public_key))
        )


class AllowList(StrictModel):
    """The committed file `reviewers.yaml`."""

    people: tuple[Person, ...]

    def find(self, identifier: str) -> Person | None:
        """The person of that identifier."""
        return next((person for person in self.people if person.id == identifier), None)


def load_allow_list(root: Path) -> AllowList:
    """People who may sign.

    Raises:
        ConfigError: Missing, malformed, a weak key, a name in disguise, or an identifier, key,
            address or name that appears twice.
    """
    found = parse_section(AllowList, read_yaml(root / ALLOW_LIST), where=ALLOW_LIST)
    for person in found.people:
        if looks := disguise(person.name):
            raise ConfigError(
                where=f"{ALLOW_LIST}: name of {person.id}",
                found=looks,
                expected="a name that a reader sees as it is written",
                action="Write the name in its usual letters.",
            )
    for what, values in (
        ("id", [person.id for person in found.people]),
        ("public_key", [person.public_key for person in found.people]),
        ("emails", [mail.casefold() for person in found.people for mail in person.emails]),
    ):
        if len(set(values)) != len(values):
            raise ConfigError(
                where=f"{ALLOW_LIST}: {what}",
                found="the same value twice",
                expected="one entry per person, key and address",
                action="One person holds one role here; remove the double entry.",
            )
    _refuse_names_alike(found.people)
    for person in found.people:
        weakness = key_weakness(bytes.fromhex(person.public_key))
        if weakness:
            raise ConfigError(
                where=f"{ALLOW_LIST}: public_key of {person.id}",
                found=weakness,
                expected="a key that the person generated",
                action="Ask the person for the key; do not copy one from elsewhere.",
            )
    return found


def _refuse_names_alike(people: Sequence[Person]) -> None:
    for one, other in itertools.combinations(people, 2):
        if any(shape(one.name) == shape(other.name) for shape in (as_read, as_drawn)):
            raise ConfigError(
                where=f"{ALLOW_LIST}: name",
                found=f"the same value twice to a reader's eye, of {one.id} and {other.id}",
                expected="names that differ by more than case, spaces, signs between letters, and "
                "letters that look alike",
                action="If they are two people, add a further name or where they work to one; "
                "one person holds one role here: else remove the double entry.",
            )


def dependence(
    reviewer: str, authors: Sequence[str], signers: Sequence[Person], allowed: AllowList
) -> str:
    """Why a review is not independent of the authors; empty if it is.

    Args:
        reviewer: Identifier that the card names.
        authors: Identifiers that the card names.
        signers: People whose signatures verified, or who is about to sign.
        allowed: The allow-list.
    """
    if not authors:
        return "the card names no author, so nobody is shown to be independent of them"
    unknown = [author for author in authors if allowed.find(author) is None]
    if unknown:
        return f"the author {unknown[0]!r} is not on {ALLOW_LIST}"
    if reviewer in authors:
        return f"{reviewer} is author and reviewer"
    both = [person.id for person in signers if person.id in authors or person.role == AUTHOR]
    if both:
        return f"{both[0]} is an author and signs; authors sign nothing"
    return ""


def spotting(spotter: str, reviewer: str, authors: Sequence[str], allowed: AllowList) -> str:
    """Why somebody cannot stand at the stop of a trial; empty if they can.

    Who reviews the card or made the candidate has an interest in the trial going on; who stops it
    has none but that nobody is hurt. An owner may.

    Args:
        spotter: Identifier that the card names.
        reviewer: Likewise; empty where nobody is named yet.
        authors: Identifiers that the card names.
        allowed: The allow-list.
    """
    person = allowed.find(spotter)
    if person is None:
        return f"the spotter {spotter!r} is not on {ALLOW_LIST}"
    if spotter in authors or person.role == AUTHOR:
        return f"{spotter} is author and spotter"
    if spotter == reviewer or person.role == REVIEWER:
        return f"{spotter} is reviewer and spotter"
    return ""
