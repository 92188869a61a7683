"""What a recorder wrote of an episode in one text: as it is, or an object or a list part by part.

Simulators write one object for all they know of an episode, `ep_meta` of robocasa, where the
instruction stands beside models of thousands of letters. As one text it is another in every
episode; what it says stands in its parts.
"""

import json
from collections.abc import Iterator
from datetime import date, datetime, time
from hashlib import sha256
from typing import Any

import numpy as np

from genpolicy.data.formats.units import tokens

MAXIMUM_TEXT = 200
# Larger objects are models and states of a simulator.
MAXIMUM_OBJECT = 1 << 20
# An object in an object in an object is a description of a scene.
MAXIMUM_DEPTH, MAXIMUM_LEAVES = 3, 256
# As wide as the embedding of a sentence; more is a picture.
WIDEST = 1024
DIGEST = 12
# Keys that say of a part of an episode where it begins and ends.
WHEN = {
    *("frame", "frames", "row", "rows", "start", "end", "begin", "stop", "from", "to"),
    *("time", "timestamp", "duration"),
}
SPANS = "\0spans"
"""Stands for a list of parts of an episode, which says what was done and when: no reason."""
Vector = tuple[float, ...]


def leaves(name: str, text: str) -> dict[str, str]:
    """A text under its name; a JSON object as its parts, `name.key`; a list as what it holds.

    The text of an object is not kept beside its parts: some of them are no reason, an outcome for
    one, and would come back with it.

    Args:
        name: What the text is called.
        text: What was written.

    Returns:
        The first 200 letters of texts by name; of an object at most 256 parts, in the order of
        their names, and nothing of what is empty. A list of one is what it holds, one of texts is
        one text, one of numbers (at most 1024) its JSON, whole, for `vector_of`; one of parts of
        the episode, with the frames at which they begin or end, is `SPANS`. Any other list and
        what is deeper is its JSON, told apart by its digest where it is longer than 200.
    """
    found = _document(text)
    if found is None:
        return {name: text[:MAXIMUM_TEXT]}
    parts = dict(_parts(name, found, 0))
    return {key: parts[key] for key in sorted(parts)[:MAXIMUM_LEAVES]}


def text_of(value: Any) -> str | None:
    """A value of any kind as a text that `leaves` takes apart; None where it says nothing.

    Args:
        value: A number, a text, a truth value, a moment, or a list, an array or a mapping of such.
    """
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, bytes):
        return value.decode("utf-8", errors="replace")
    if isinstance(value, str | bool | int | float):
        return str(value)
    if isinstance(value, date | datetime | time):
        return value.isoformat()
    if isinstance(value, list | tuple | dict) and value:
        return json.dumps(value, default=text_of)
    return None


def vector_of(text: str) -> Vector | None:
    """The numbers of a text that is a JSON list of several numbers, as `leaves` keeps it."""
    found = _document(text) if text[:1] == "[" else None
    return tuple(map(float, found)) if isinstance(found, list) and _is_vector(found) else None


def holds_several(text: str) -> bool:
    """Whether a text is a JSON list of more than one thing."""
    found = _document(text)
    return isinstance(found, list) and len(found) > 1


def cut(text: str) -> str:
    """A text of at most 200 letters, which still differs where the whole differed."""
    if len(text) <= MAXIMUM_TEXT:
        return text
    digest = sha256(text.encode()).hexdigest()[:DIGEST]
    return f"{text[: MAXIMUM_TEXT - DIGEST - 3]}… #{digest}"


def _document(text: str) -> dict[str, Any] | list[Any] | None:
    plain = text.strip()
    ends = (plain[:1], plain[-1:])
    if ends not in (("{", "}"), ("[", "]")) or len(plain) > MAXIMUM_OBJECT:
        return None
    try:
        found = json.loads(plain)
    except (ValueError, RecursionError):
        return None
    return found if isinstance(found, dict | list) else None


def _parts(name: str, value: Any, depth: int) -> Iterator[tuple[str, str]]:
    if isinstance(value, list) and len(value) == 1 and not isinstance(value[0], list | dict):
        value = value[0]
    if isinstance(value, dict) and depth < MAXIMUM_DEPTH:
        for key, part in value.items():
            yield from _parts(f"{name}.{key}", part, depth + 1)
    elif isinstance(value, str | bool | int | float):
        yield name, str(value)[:MAXIMUM_TEXT]
    elif isinstance(value, list) and _is_vector(value):
        yield name, json.dumps(value)
    elif isinstance(value, list) and value and all(isinstance(item, str) for item in value):
        yield name, cut(", ".join(value))
    elif _tells_when(value, depth):
        yield name, SPANS
    elif value is not None and value != []:
        yield name, cut(json.dumps(value))


def _tells_when(value: Any, depth: int) -> bool:
    """Whether a list holds mappings that say where in the episode each belongs, or is in one."""
    if depth > 2 * MAXIMUM_DEPTH:
        return False
    if isinstance(value, list):
        return any(_is_span(item) or _tells_when(item, depth + 1) for item in value)
    if isinstance(value, dict):
        return any(_tells_when(item, depth + 1) for item in value.values())
    return False


def _is_span(value: Any) -> bool:
    if not isinstance(value, dict):
        return False
    places = [key for key, place in value.items() if isinstance(place, int | float)]
    return any(WHEN & {*tokens(str(key))} for key in places)


def _is_vector(value: list[Any]) -> bool:
    plain = all(isinstance(item, int | float) for item in value)
    return plain and 1 < len(value) <= WIDEST
