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
MAXIMUM_DEPTH, MAXIMUM_LEAVES = 3, 256


def leaves(name: str, text: str) -> dict[str, str]:
    """A text under its name; a JSON object as its parts, `name.key`.

    The text of an object is not kept beside its parts: some of them are no reason, an outcome for
    one, and would come back with it.

    Args:
        name: What the text is called.
        text: What was written.

    Returns:
        The first 200 letters of texts by name; of an object at most 256 parts, in the order of
        their names, a list and what is deeper as its JSON, and nothing of what is empty.
    """
    found = _object(text)
    if found is None:
        return {name: text[:MAXIMUM_TEXT]}
    parts = dict(_parts(name, found, 1))
    return {key: parts[key][:MAXIMUM_TEXT] for key in sorted(parts)[:MAXIMUM_LEAVES]}


def _object(text: str) -> dict[str, object] | None:
    plain = text.strip()
    if not (plain.startswith("{") and plain.endswith("}") and len(plain) <= MAXIMUM_OBJECT):
        return None
    try:
        found = json.loads(plain)
    except (ValueError, RecursionError):
        return None
    return found if isinstance(found, dict) else None


def _parts(name: str, found: dict[str, object], depth: int) -> Iterator[tuple[str, str]]:
    for key, value in found.items():
        if isinstance(value, dict) and depth < MAXIMUM_DEPTH:
            yield from _parts(f"{name}.{key}", value, depth + 1)
        elif value is not None:
            plain = isinstance(value, str | bool | int | float)
            yield f"{name}.{key}", str(value) if plain else json.dumps(value)
