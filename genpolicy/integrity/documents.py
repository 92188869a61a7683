"""Strict readers and one canonical writer for JSON and YAML documents.

The standard readers accept NaN, keep the last of two equal keys and, for YAML, expand alias
bombs. A document that decides something must not be ambiguous, so all of that is refused here.
"""

import json
import math
from collections.abc import Hashable
from pathlib import Path
from typing import Any, NoReturn

import yaml

from genpolicy.errors import BadInputError, ConfigError, ContractError

MAXIMUM_DOCUMENT_BYTES = 16 << 20
MAXIMUM_ALIASES = 32
MAXIMUM_QUICK_DEPTH = 1000
READ_OTHERWISE = ("\t", "?", "!", "|#", ">#")
"""What libyaml takes in places in which the parser in Python refuses it, or makes something else
of."""


def canonical_json(value: Any) -> bytes:
    """The one serialisation of `value`: sorted keys, two-space indent, UTF-8, final newline.

    Raises:
        ContractError: A float in `value` is NaN or infinite, or a text has no UTF-8 form.
    """
    try:
        text = json.dumps(value, sort_keys=True, indent=2, ensure_ascii=False, allow_nan=False)
        return text.encode() + b"\n"
    except ValueError as error:
        raise ContractError(
            where="a JSON document to be written",
            found=str(error),
            expected="finite numbers and plain text only",
            action="Write null for a value that is unknown; never NaN.",
        ) from error


def parse_json(data: bytes, *, where: str) -> Any:
    """Parse JSON; refuses duplicate keys, NaN, infinities, other encodings and huge inputs.

    Raises:
        BadInputError: The document breaks one of these rules.
    """
    _check_size(data, where)

    def pairs(items: list[tuple[str, Any]]) -> dict[str, Any]:
        result: dict[str, Any] = {}
        for key, item in items:
            if key in result:
                _refuse(where, f"a document with the key {key!r} twice", "unique keys")
            result[key] = item
        return result

    def constant(name: str) -> NoReturn:
        _refuse(where, f"a document with {name}", "finite numbers")

    def number(text: str) -> float:
        value = float(text)
        if not math.isfinite(value):
            _refuse(where, f"a document with {text}", "finite numbers")
        return value

    try:
        return json.loads(
            data.decode("utf-8"),
            object_pairs_hook=pairs,
            parse_constant=constant,
            parse_float=number,
        )
    except (ValueError, RecursionError) as error:
        _refuse(where, f"not JSON ({error})", "one UTF-8 JSON document")


def read_json(path: Path) -> Any:
    """`parse_json` of a file.

    Raises:
        BadInputError: Missing or malformed.
    """
    return parse_json(_read(path), where=str(path))


def parse_yaml(data: bytes, *, where: str) -> Any:
    """Parse YAML with the safe loader; refuses duplicate keys, alias bombs and huge inputs.

    Raises:
        ConfigError: The document breaks one of these rules.
    """
    _check_size(data, where)
    try:
        return _parsed(data.decode("utf-8"))
    except (ValueError, TypeError, yaml.YAMLError, RecursionError) as error:
        raise ConfigError(
            where=where,
            found=f"not readable ({' '.join(str(error).split())})",
            expected="one plain UTF-8 YAML document with unique keys",
            action="Correct the file at the place named.",
        ) from error


def read_yaml(path: Path) -> Any:
    """`parse_yaml` of a file.

    Raises:
        ConfigError: Missing or malformed.
    """
    return parse_yaml(_read(path), where=str(path))


def _parsed(text: str) -> Any:
    """What the text says: by libyaml, a sixth of the time, or by Python where it must be.

    libyaml nests as deep as the text does and takes the process with it where that is too deep, and
    says less well what is wrong: such texts are read, or refused, by the parser in Python, as is
    whatever the two might read otherwise.
    """
    otherwise = any(sign in text for sign in READ_OTHERWISE)
    if not otherwise and _deepest(text) < MAXIMUM_QUICK_DEPTH:
        try:
            return _QuickLoader(text).get_single_data()
        except (ValueError, TypeError, yaml.YAMLError):
            pass
    loader = _StrictLoader(text)
    try:
        return loader.get_single_data()
    finally:
        loader.dispose()


def _deepest(text: str) -> int:
    """No less than the depth to which a text nests.

    A level in brackets takes one of them, any other one a column.
    """
    return text.count("[") + text.count("{") + max(map(len, text.splitlines()), default=0)


class _UniqueKeys(yaml.constructor.SafeConstructor):
    """PyYAML's safe constructor of mappings with unique keys."""

    def construct_mapping(self, node: Any, deep: bool = False) -> dict[Hashable, Any]:
        seen: set[Hashable] = set()
        for key_node, _ in node.value:
            key = self.construct_object(key_node, deep=True)
            if key in seen:
                raise yaml.YAMLError(f"key {key!r} twice, line {key_node.start_mark.line + 1}")
            seen.add(key)
        return super().construct_mapping(node, deep=deep)


class _StrictLoader(_UniqueKeys, yaml.SafeLoader):
    """PyYAML's safe loader with unique keys and a cap on aliases."""

    aliases = 0

    def compose_node(self, parent: Any, index: Any) -> Any:
        if self.check_event(yaml.AliasEvent):
            self.aliases += 1
            if self.aliases > MAXIMUM_ALIASES:
                raise yaml.YAMLError(f"more than {MAXIMUM_ALIASES} aliases")
        return super().compose_node(parent, index)


class _QuickLoader(_UniqueKeys, yaml.CSafeLoader):
    """The same over libyaml, which composes out of sight: an alias is a node met once more."""

    def get_single_node(self) -> Any:
        root = super().get_single_node()
        left, met, aliases = [root], {id(root)}, 0
        while left:
            node = left.pop()
            inside = [] if node is None or isinstance(node, yaml.ScalarNode) else node.value
            for item in inside:
                for one in item if isinstance(item, tuple) else (item,):
                    aliases += id(one) in met
                    if id(one) not in met:
                        met.add(id(one))
                        left.append(one)
        if aliases > MAXIMUM_ALIASES:
            raise yaml.YAMLError(f"more than {MAXIMUM_ALIASES} aliases")
        return root


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise BadInputError(
            where=str(path),
            found=f"not readable ({error.strerror})",
            expected="a readable file",
            action="Check the path, or run the stage that writes it.",
        ) from error


def _check_size(data: bytes, where: str) -> None:
    if len(data) > MAXIMUM_DOCUMENT_BYTES:
        _refuse(where, f"{len(data)} bytes", f"at most {MAXIMUM_DOCUMENT_BYTES} bytes")


def _refuse(where: str, found: str, expected: str) -> NoReturn:
    raise BadInputError(
        where=where, found=found, expected=expected, action="Correct or re-generate the document."
    )
