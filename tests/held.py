"""Documents held against versions of them that lie beside the tests.

A version is written by `GOLDEN=write python -m pytest -n 0 FILE`, which is red by design: read the
difference, then ask again. It says that something moved and never that a number is right.
"""

import inspect
import json
import os
import re
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import pytest

ROUNDING = 1e-9
"""Of a number as a share of it, and about 0: what another library of algebra may add."""

SERIES = re.compile(r"\[(?:\s+-?[\w.+-]+,){2,}\s+-?[\w.+-]+\s+\]")
"""A list of three numbers or more, which takes one line."""


def hold(file: Path, found: dict[str, Any]) -> None:
    """Compare with a file; with GOLDEN=write, write it, and be red."""
    if os.environ.get("GOLDEN") == "write":
        file.parent.mkdir(exist_ok=True)
        text = json.dumps(found, indent=1, sort_keys=True, ensure_ascii=False)
        file.write_text(SERIES.sub(lambda series: " ".join(series[0].split()), text) + "\n")
        pytest.fail(f"{file.name} was written: read the difference, then ask again")
    assert list(differences(json.loads(file.read_text()), found)) == []


def differences(golden: Any, found: Any, place: str = "") -> Iterator[tuple[str, Any, Any]]:
    """Places at which two documents differ, with both values."""
    if isinstance(golden, dict) and isinstance(found, dict):
        for key in sorted({*golden, *found}):
            yield from differences(golden.get(key), found.get(key), f"{place}/{key}")
    elif isinstance(golden, list) and isinstance(found, list) and len(golden) == len(found):
        for number, pair in enumerate(zip(golden, found, strict=True)):
            yield from differences(*pair, f"{place}/{number}")
    elif type(golden) is type(found) is float:
        if found != pytest.approx(golden, rel=ROUNDING, abs=ROUNDING, nan_ok=True):
            yield place, golden, found
    elif golden != found or type(golden) is not type(found):
        yield place, golden, found


def name_of(item: Any) -> str:
    """Where a class or a function stands."""
    return f"{item.__module__}.{item.__qualname__}"


def forms(
    constants: dict[str, Any], functions: list[Any], data: list[type], models: list[Any]
) -> dict[str, dict[str, float]]:
    """Numbers that code itself holds: constants, defaults of arguments, bounds of settings."""
    defaults = {
        f"{name_of(item)}({argument.name})": argument.default
        for item in (*functions, *data)
        for argument in inspect.signature(item).parameters.values()
    }
    bounds = {name_of(kind): kind.model_json_schema() for kind in models}
    found = {"constants": constants, "defaults": defaults, "bounds": bounds}
    return {name: dict(numbers(values, name)) for name, values in found.items()}


def numbers(value: Any, place: str) -> Iterator[tuple[str, float]]:
    """Numbers in a value of a module, with where they stand; nothing of what is not plain data."""
    if isinstance(value, (bool, int, float)):
        yield place, value
    elif isinstance(value, dict):
        for key, item in value.items():
            yield from numbers(item, f"{place}.{key}")
    elif isinstance(value, (tuple, list)):
        for index, item in enumerate(value):
            yield from numbers(item, f"{place}.{index}")
    elif is_dataclass(value) and not isinstance(value, type):
        for field in fields(value):
            yield from numbers(getattr(value, field.name), f"{place}.{field.name}")
