"""The index of a bundle: which files it holds, by hash, and which of them are which group's.

Its SHA-256 is the bundle's address: it names every byte of the run, and nothing of the archive
around it (order, compression, time).
"""

from pathlib import PurePosixPath
from typing import Annotated, Literal, Self

from pydantic import Field, ValidationError, model_validator

from gates.report import Gate, StrictModel
from genpolicy.errors import IntegrityError
from genpolicy.integrity.documents import canonical_json, parse_json
from genpolicy.integrity.hashing import sha256_bytes

Sha256 = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]


class BundledFile(StrictModel):
    """One file of the run.

    Attributes:
        sha256: Of its bytes.
        size: In bytes.
        executable: Whether it is a program.
    """

    sha256: Sha256
    size: int = Field(ge=0)
    executable: bool = False


class BundledGroup(StrictModel):
    """One of the eleven groups.

    Attributes:
        number: In the chapter's order.
        title: What it is.
        files: Paths of its files.
        unmeasured: What of it was not measured of this candidate; empty where all was.
    """

    number: int
    title: str
    files: list[str] = Field(min_length=1)
    unmeasured: str = ""


class BundleIndex(StrictModel):
    """The index.

    Attributes:
        schema_version: Of this form.
        candidate: Name of the candidate.
        checkpoint: SHA-256 that identifies its weights.
        commit: Of the checkout that it was packaged from; empty where git does not say, or where
            the code is not the committed one.
        verdicts: Of gates A to D.
        groups: The eleven groups.
        files: Every file that the verdicts rest on, by path from the root of the workspace.
        statements: SHA-256 of the statement of each gate.
        limits: What git said, where it was packaged, of limits that moved after their evidence and
            of those that are overridden; a bundle has no history to derive it from again.
    """

    schema_version: Literal[1]
    candidate: str
    checkpoint: Sha256
    commit: Annotated[str, Field(pattern=r"^([0-9a-f]{40})?$")]
    verdicts: dict[Gate, str]
    groups: list[BundledGroup]
    files: dict[str, BundledFile]
    statements: dict[Gate, Sha256]
    limits: list[str]

    @model_validator(mode="after")
    def _paths(self) -> Self:
        """Paths stay below the folder that they are unpacked into, and groups name files."""
        names = set(self.files)
        for name in self.files:
            path = PurePosixPath(name)
            plain = name.isprintable() and "\\" not in name and path.as_posix() == name
            if not plain or not path.parts or path.is_absolute() or ".." in path.parts:
                raise ValueError(f"files: {name!r:.80} is no path below the workspace")
            above = {parent.as_posix() for parent in path.parents} & names
            if above:
                raise ValueError(f"files: {min(above)!r:.80} is a file and a folder")
        unknown = {name for group in self.groups for name in group.files} - names
        if unknown:
            raise ValueError(f"groups: {min(unknown)!r:.80} is none of the files")
        return self

    def data(self) -> bytes:
        """The index as it lies in the bundle."""
        return canonical_json(self.model_dump(mode="json"))

    @property
    def address(self) -> str:
        """SHA-256 of the index: the name of the bundle by its content."""
        return sha256_bytes(self.data())


def parse_index(data: bytes, *, where: str) -> BundleIndex:
    """Read an index.

    Raises:
        IntegrityError: It is no index, or not in its one form.
    """
    try:
        index = BundleIndex.model_validate(parse_json(data, where=where))
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"])
        raise _refused(where, f"not an index ({place or 'document'}: {first['msg']})") from error
    if index.data() != data:
        raise _refused(where, "an index in another form than it is written in")
    return index


def _refused(where: str, found: str) -> IntegrityError:
    return IntegrityError(
        where=where,
        found=found,
        expected="an index as `genpolicy package` writes it",
        action="Ask for the bundle again, and compare its address.",
    )
