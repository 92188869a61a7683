"""The caveat ledger: claims of others by kind, each with its source and its place in it.

A number of a paper is text here. No field of the ledger is a number, no setting and no limit takes
an entry, and nothing that judges or ranks may import this module (an import contract).
"""

import textwrap
from collections import Counter
from pathlib import Path
from typing import Annotated, Literal, Self, get_args

from pydantic import Field, model_validator

from gates.report import StrictModel, parse_section
from genpolicy.errors import BadInputError
from genpolicy.integrity.documents import parse_yaml

LEDGER = "gates/ledger/ledger.yaml"
Kind = Literal["matched", "source_specific", "abstract_only", "unmatched"]
KINDS: tuple[Kind, ...] = get_args(Kind)
OURS = "reports/"
"""How the place of a matched claim begins: only a report of this ladder matches anything."""

Text = Annotated[str, Field(pattern=r"\S")]


class Claim(StrictModel):
    """One claim, in words.

    Attributes:
        id: Name of the entry.
        kind: How far it carries: said by our own matched comparison; told of the conditions
            of its source, inspected there only if the locator says so;
            known from an abstract; or neither inspected in a known place nor comparable.
        source: Whose it is.
        locator: Where in the source it stands, or that no place is known.
        claim: What is said, its numbers included.
        does_not_show: What must not be concluded from it.
    """

    id: Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$")]
    kind: Kind
    source: Text
    locator: Text
    claim: Text
    does_not_show: Text

    @model_validator(mode="after")
    def _matched_by_ourselves_alone(self) -> Self:
        if (self.kind == "matched") != self.locator.startswith(OURS):
            raise ValueError(
                f"{self.id}: a claim is matched if a report of this ladder ({OURS}...) says it, "
                "and not otherwise"
            )
        return self


class Ledger(StrictModel):
    """All claims.

    Attributes:
        schema_version: Version of this model.
        claims: In the order of reading.
    """

    schema_version: Literal[1]
    claims: tuple[Claim, ...] = Field(min_length=1)

    @model_validator(mode="after")
    def _each_once(self) -> Self:
        twice = [name for name, n in Counter(claim.id for claim in self.claims).items() if n > 1]
        if twice:
            raise ValueError(f"twice: {', '.join(twice)}")
        return self


def read_ledger(path: Path | None = None) -> Ledger:
    """The ledger that this code carries, or another file of its form.

    Raises:
        ConfigError: Malformed, an unknown key, or a value that is no text.
    """
    file = path or Path(__file__).with_name("ledger.yaml")
    return parse_section(Ledger, parse_yaml(file.read_bytes(), where=LEDGER), where=LEDGER)


def claims_of(ledger: Ledger, kind: str) -> tuple[Claim, ...]:
    """Claims of one kind; all of them where none is named.

    Raises:
        BadInputError: There is no such kind.
    """
    if kind and kind not in KINDS:
        raise BadInputError(
            where="--kind", found=repr(kind), expected=", ".join(KINDS), action="Name one of them."
        )
    return tuple(claim for claim in ledger.claims if kind in ("", claim.kind))


def ledger_text(claims: tuple[Claim, ...]) -> str:
    """For a terminal: kind after kind, each claim with its place and what it does not show."""
    lines = []
    for kind in KINDS:
        own = [claim for claim in claims if claim.kind == kind]
        if own:
            lines.append(f"{kind}: {len(own)}")
        for claim in own:
            lines.append(f"  {claim.id} · {claim.source}")
            for said in (
                f"says: {claim.claim}",
                f"where: {claim.locator}",
                f"does not show: {claim.does_not_show}",
            ):
                lines.append(
                    textwrap.fill(said, 80, initial_indent=" " * 4, subsequent_indent=" " * 6)
                )
    return "\n".join(lines)
