"""What a recorder wrote of an episode in one text: as it is, or a JSON object part by part.

Simulators write one object for all they know of an episode, `ep_meta` of robocasa, where the
instruction stands beside models of thousands of letters. As one text it is another in every
episode; what it says stands in its parts.
"""

import json
from collections.abc import Iterator

MAXIMUM_TEXT = 200
# Larger objects are models and states of a simulator.
MAXIMUM_OBJECT = 1 << 20
# An object in an object in an object is a description of a scene.
MAXIMUM_DEPTH, MAXIMUM_LEAVES = 3, 64


def leaves(name: str, text: str) -> dict[str, str]:
    """A text under its name; a JSON object as its scalar parts, `name.key`.

    Args:
        name: What the text is called.
        text: What was written.

    Returns:
        Texts of at most 200 letters by name; of an object at most 64, in the order of their names,
        and none of lists, of what is empty and of what is longer.
    """
    found = _object(text)
    if found is None:
        return {name: text[:MAXIMUM_TEXT]}
    short = {key: value for key, value in _scalars(name, found, 1) if len(value) <= MAXIMUM_TEXT}
    return {key: short[key] for key in sorted(short)[:MAXIMUM_LEAVES]}


def _object(text: str) -> dict[str, object] | None:
    plain = text.strip()
    if not (plain.startswith("{") and plain.endswith("}") and len(plain) <= MAXIMUM_OBJECT):
        return None
    try:
        found = json.loads(plain)
    except (ValueError, RecursionError):
        return None
    return found if isinstance(found, dict) else None


def _scalars(name: str, found: dict[str, object], depth: int) -> Iterator[tuple[str, str]]:
    for key, value in found.items():
        if isinstance(value, dict):
            if depth < MAXIMUM_DEPTH:
                yield from _scalars(f"{name}.{key}", value, depth + 1)
        elif isinstance(value, str | bool | int | float):
            yield f"{name}.{key}", str(value)
