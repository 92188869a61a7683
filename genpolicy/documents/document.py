"""JSON documents as dataclasses: a key is spelled once, where its class says what it means.

Who writes builds the class, so that a misspelt key is a type error; who reads refuses a document
with other keys or types by name. The classes are plain frozen dataclasses without defaults: a key
that may be left out is a key that nobody misses.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Generic, TypeVar

from pydantic import ConfigDict, Field, TypeAdapter, ValidationError

from genpolicy.errors import IntegrityError
from genpolicy.integrity.atomic import write_bytes
from genpolicy.integrity.documents import canonical_json, read_json

Content = TypeVar("Content")
Count = Annotated[int, Field(ge=0)]
"""What counts is never below zero: it would take something else away."""

STRICT = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)
UNKNOWN = ("unexpected_keyword_argument", "extra_forbidden")
SAID = 4
"""Misfits that a message names; a document of another version may have hundreds."""


class Document(Generic[Content]):
    """A kind of JSON document.

    Args:
        file: Name of the file.
        kind: Dataclass of its content, or a list or mapping of such.
    """

    def __init__(self, file: str, kind: type[Content]) -> None:
        self.file, self.kind = file, kind
        # Standard dataclasses inside a tuple take its configuration, at any depth.
        self._form: TypeAdapter[tuple[Content]] = TypeAdapter(
            tuple[kind],  # type: ignore[arg-type, valid-type]
            config=STRICT,
        )

    def parse(self, value: Any, *, where: str) -> Content:
        """The content of a document that `parse_json` has read.

        Args:
            value: What it read.
            where: The document, for the message.

        Raises:
            IntegrityError: An unknown or missing key, or a value of another type.
        """
        try:
            return self._form.validate_json(json.dumps([value]))[0]
        except ValidationError as error:
            raise IntegrityError(
                where=where,
                found=f"a document with {_misfits(error)}",
                expected=f"the keys and types of {self.file} that this version writes",
                action="Run the stage that writes it again (`dvc repro`).",
            ) from error

    def read(self, folder: Path) -> Content:
        """The content of the file in a folder.

        Raises:
            IntegrityError: As `parse`.
            BadInputError: Missing, or not strict JSON.
        """
        path = folder / self.file
        return self.parse(read_json(path), where=str(path))

    def plain(self, content: Content) -> Any:
        """The content as JSON knows it: mappings, lists, text and numbers.

        A value of another type than its field says is a mistake of ours and raises pydantic's
        `PydanticSerializationError`: nobody could read it back.
        """
        return self._form.dump_python((content,), mode="json", warnings="error")[0]

    def write(self, folder: Path, content: Content) -> None:
        """Write the file into a folder, whole or not at all; the same content, the same bytes.

        Raises:
            BadInputError: The place cannot be written.
            ContractError: A number is NaN or infinite.
        """
        write_bytes(folder / self.file, canonical_json(self.plain(content)))


def _misfits(error: ValidationError) -> str:
    # Unknown keys first: of a misspelt one that says most.
    errors = sorted(error.errors(include_url=False), key=lambda item: item["type"] not in UNKNOWN)
    found = [_misfit(item) for item in errors]
    more = [f"{len(found) - SAID} more misfits"] if len(found) > SAID else []
    return ", ".join([*found[:SAID], *more])


def _misfit(error: Mapping[str, Any]) -> str:
    """What is wrong at one place; the first part of each place is the tuple of `Document`."""
    place = ".".join(str(part) for part in error["loc"][1:])
    if error["type"] in UNKNOWN:
        return f"the unknown key {place}"
    if error["type"] == "missing":
        return f"the missing key {place}"
    told = f"{error['input']!r:.40} ({error['msg']})"
    return f"{place} = {told}" if place else told
