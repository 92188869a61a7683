"""An entry's fields as its author wrote them: what is wrong is one sentence that he can act on."""

import re
from collections.abc import Mapping
from typing import Any, TypeVar

from pydantic import ValidationError

from genpolicy.candidates.wire.entry import Entry
from genpolicy.contract.settings import parse_settings
from genpolicy.errors import ConfigError

Kind = TypeVar("Kind", bound=Entry)

DOCS = "See docs/candidates.md."
LONGEST = 60
"""Characters of a value that an error repeats."""


def parse_entry(kind: type[Kind], values: Mapping[str, Any], *, where: str) -> Kind:
    """The entry that a map describes.

    Args:
        kind: What it is to be.
        values: Its fields.
        where: Its file.

    Raises:
        ConfigError: A field that is missing, unknown or wrong, or two that contradict each other.
    """
    if _holds_zero(values):
        raise ConfigError(
            where=where, found="a text with a character of number 0",
            expected="names of files and words that a machine takes", action=f"Remove it. {DOCS}",
        )  # fmt: skip
    try:
        return parse_settings(kind, values, where=where)
    except ConfigError as error:
        cause = error.__cause__
        assert isinstance(cause, ValidationError)  # nothing else makes it one
        first: Mapping[str, Any] = cause.errors(include_url=False)[0]
        place, field = error.where, str(first["loc"][-1]) if first["loc"] else ""
        if first["type"] == "missing":
            raise ConfigError(
                where=place, found="missing", expected=f"a value of `{field}`",
                action=f"Write it into the entry. {DOCS}",
            ) from error  # fmt: skip
        if first["type"] == "extra_forbidden":
            raise ConfigError(
                where=place, found="a field that nothing knows",
                expected=f"the fields of a candidate of kind {values.get('kind')}",
                action=f"Correct its name, or leave it out. {DOCS}",
            ) from error  # fmt: skip
        if first["type"] == "value_error":
            rule = str(first["ctx"]["error"])
            raise ConfigError(
                where=place, found=_named(first["input"], rule),
                expected=f"what is consistent: {rule}", action=f"Correct the entry. {DOCS}",
            ) from error  # fmt: skip
        raise


def _holds_zero(value: Any) -> bool:
    """Whether a text anywhere in it could end a path or a word of a command too early."""
    if isinstance(value, Mapping):
        return any(_holds_zero(item) for pair in value.items() for item in pair)
    if isinstance(value, list):
        return any(map(_holds_zero, value))
    return isinstance(value, str) and "\0" in value


def _named(given: Any, rule: str) -> str:
    """What the fields that a rule speaks of say; where it names none, which fields there are."""
    if not isinstance(given, Mapping):
        return repr(given)[:LONGEST]
    spoken = [name for name in given if re.search(rf"\b{re.escape(str(name))}\b", rule)]
    if not spoken:
        return f"with the fields {', '.join(map(str, given))}"
    return ", ".join(f"{name}: {_short(given[name])}" for name in spoken)


def _short(value: Any) -> str:
    said = repr(value)
    return said if len(said) <= LONGEST else f"{said[:LONGEST]}…"
