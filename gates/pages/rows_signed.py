"""Rows of Gate E: who has to sign the card, who did, by which key, and over which bytes.

They are of the envelope and the allow-list that the report names; of other bytes nothing is shown.
"""

from collections.abc import Sequence
from pathlib import Path

import pyarrow as pa

from gates.card.card import DRAFT_PATH
from gates.card.papers import Papers, examine
from gates.card.people import ALLOW_LIST, REVIEWER, SIGNERS, Person, load_allow_list
from gates.card.signing import envelope_path, statement
from gates.evidence import Evidence
from gates.pages.rows_files import RowsFile, sampled
from gates.report import GateReport
from genpolicy.errors import GenpolicyError
from genpolicy.integrity.hashing import sha256_bytes

NAME = "signatures.csv"
SIGNED, WAITS, UNDECIDED, REFUSED = "signed", "waits", "not needed", "refused"
"""Of a role: by a signature that verifies; nobody yet; of a person whom nobody waits for; void."""
KEY_DIGITS = 16
HEAD = ("role", "person", "key", "card_sha256", "from", "until", "verdict", "why")


def signature_rows(root: Path, report: GateReport) -> RowsFile | None:
    """A row for the reviewer and each owner, and for whoever signed besides.

    Returns:
        None where card, list, draft or chain are other bytes than were judged.
    """
    path = envelope_path(str(report.settings["card"]))
    evidence = Evidence(root)
    chain = [name for name in report.materials if name.startswith("reports/")]
    for name in (path, ALLOW_LIST, DRAFT_PATH, *chain):
        if evidence.digest(name) != report.materials.get(name, ""):
            return None
    papers = examine(root, str(report.settings["card"]))
    lines = [dict(zip(HEAD, line, strict=True)) for line in _lines(root, papers)]
    return sampled(path, "", NAME, pa.Table.from_pylist(lines))


def _lines(root: Path, papers: Papers) -> list[tuple[str, ...]]:
    signers = papers.signed.signers if papers.signed else ()
    days = ("", "")
    digest = ""
    if papers.signed:
        card = papers.signed.card
        days = (card.not_before, card.expires)
        digest = sha256_bytes(statement(root, card))
    people = _listed(root)
    found: list[tuple[str, ...]] = []
    for role in SIGNERS:
        own = [person for person in signers if person.role == role]
        found += [
            (role, person.id, fingerprint(person), digest, *days, SIGNED, "") for person in own
        ]
        if not own and papers.present and papers.refusal:
            found.append((role, "", "", "", "", "", REFUSED, papers.refusal))
        elif not own:
            found.append((role, "", "", digest, *days, WAITS, _who(people, role, papers)))
    others = (person for person in signers if person.role not in SIGNERS)
    return found + [
        (one.role, one.id, fingerprint(one), digest, *days, UNDECIDED, "") for one in others
    ]


def fingerprint(person: Person) -> str:
    """First digits of what a person's public key is called."""
    return person.key.keyid[:KEY_DIGITS]


def _listed(root: Path) -> Sequence[Person] | None:
    """Everybody on the list; None where it cannot be read."""
    try:
        return load_allow_list(root).people
    except GenpolicyError:
        return None


def _who(people: Sequence[Person] | None, role: str, papers: Papers) -> str:
    """Who of the list may sign in a role; of reviewers the one whom a signed card names."""
    if role == REVIEWER and papers.signed:
        return f"for {papers.signed.card.reviewer}, whom the card names"
    if people is None:
        return f"{ALLOW_LIST} cannot be read"
    names = [person.id for person in people if person.role == role]
    return f"for {' or '.join(names)}" if names else f"nobody on {ALLOW_LIST} has this role"
