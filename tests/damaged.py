"""Documents with one thing wrong: every place of them holding what nobody meant."""

import copy
import datetime
import json
from collections.abc import Iterator
from typing import Any

import yaml

from genpolicy.seeds import stream

DAY = datetime.date(2026, 11, 20)
WRONG: tuple[Any, ...] = (
    None, True, False, 0, -1, 10**400, 1e308, "", "text", "\x00", "é" * 3000, [], {}, [[]], [None],
    {"a": {"b": [None]}}, [{"a": 1}], {"": ""},
)  # fmt: skip
"""What stands in place of a value. JSON and YAML can both say it."""
WRONG_IN_YAML: tuple[Any, ...] = (*WRONG, DAY, float("nan"), float("inf"), b"\xff", {1: 2}, {None})
"""YAML has more types than the documents have."""


def places_of(document: Any, at: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Every place of a document, the document itself first; of a long list the first two."""
    yield at
    if isinstance(document, dict):
        for key, value in document.items():
            yield from places_of(value, (*at, key))
    elif isinstance(document, list):
        for index, value in enumerate(document[:2]):
            yield from places_of(value, (*at, index))


def replaced(document: Any, at: tuple[Any, ...], value: Any) -> Any:
    """A copy of a document with another value at a place."""
    if not at:
        return value
    made = copy.deepcopy(document)
    inner = made
    for part in at[:-1]:
        inner = inner[part]
    inner[at[-1]] = value
    return made


def as_yaml(document: Any) -> bytes:
    """A document as YAML, whatever it holds."""
    return yaml.dump(document, allow_unicode=True).encode()


def as_json(document: Any) -> bytes:
    """A document as JSON, whatever it holds."""
    return json.dumps(document).encode()


def broken_bytes(data: bytes) -> Iterator[tuple[str, bytes]]:
    """A file that is no document, or says two things at once."""
    yield "empty", b""
    yield "blank", b" \n"
    yield "a third of it", data[: len(data) // 3]
    yield "all but its end", data[: max(len(data) - 3, 0)]
    yield "not UTF-8", data[: len(data) // 2] + b"\xff\xfe" + data[len(data) // 2 :]
    yield "zeros", bytes(64)
    yield "twice", data + data
    yield "a mark of order", b"\xef\xbb\xbf" + data
    yield "deep", b"[" * 100_000
    yield "a list", b"[1, 2]"
    yield "a text", b'"text"'
    yield "a number", b"7"
    first = data.lstrip().splitlines()[:2]
    yield (
        "two keys",
        b"{" + first[-1].strip(b", ") + b"," + data.lstrip()[1:]
        if (data.lstrip().startswith(b"{"))
        else data + b"\n" + data,
    )


def damaged(
    name: str, document: Any, *, each: int, limit: int, yaml_too: bool = True
) -> Iterator[tuple[str, bytes]]:
    """Damaged documents with what was done to them.

    Args:
        name: Names the draw; the same damage every time.
        document: The whole one.
        each: How many wrong values each place gets.
        limit: Most documents; places are drawn beyond it.
        yaml_too: Written as YAML, which has more types.
    """
    values, write = (WRONG_IN_YAML, as_yaml) if yaml_too else (WRONG, as_json)
    generator = stream(0, "damaged", name)
    places = list(places_of(document))
    chosen = [
        (place, int(index))
        for place in places
        for index in generator.choice(len(values), size=min(each, len(values)), replace=False)
    ]
    order = generator.permutation(len(chosen))[:limit]
    for number in sorted(order.tolist()):
        place, index = chosen[number]
        where = ".".join(map(str, place)) or "everything"
        yield f"{where} = {values[index]!r:.40}", write(replaced(document, place, values[index]))
