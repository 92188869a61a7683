"""The form of what the gates pass on: nobody writes into it.

Asked of every class and function of `gates` at once. A verdict that could be written over after it
was judged, or settings that take `yes` for 1.0, would be wrong in one place; here they are in none.
"""

import importlib
import inspect
import pkgutil
from dataclasses import FrozenInstanceError, fields, is_dataclass
from types import FunctionType

import pytest
from pydantic import BaseModel

import gates

MODULES = [
    importlib.import_module(item.name)
    for item in pkgutil.walk_packages(gates.__path__, "gates.")
    if item.name != "gates.__main__"
]


def _own(kind: type) -> list:
    return [
        item
        for module in MODULES
        for item in vars(module).values()
        if isinstance(item, kind) and item.__module__ == module.__name__
    ]


CLASSES = _own(type)
DATA = [item for item in CLASSES if is_dataclass(item)]
MODELS = [item for item in CLASSES if issubclass(item, BaseModel)]
FUNCTIONS = [
    *_own(FunctionType),
    *(
        method
        for item in CLASSES
        for method in vars(item).values()
        if isinstance(method, FunctionType) and method.__module__ == item.__module__
        if not getattr(item, "_is_protocol", False)
    ),
]


def _name(item: type | FunctionType) -> str:
    return f"{item.__module__}.{item.__qualname__}"


def test_there_are_classes_and_functions_to_ask():
    assert len(DATA) > 30 and len(MODELS) > 10 and len(FUNCTIONS) > 500


@pytest.mark.parametrize("kind", DATA, ids=_name)
def test_nobody_writes_into_a_value_of_the_gates(kind):
    empty = object.__new__(kind)
    with pytest.raises(FrozenInstanceError):
        setattr(empty, (fields(kind) or [None])[0].name, None)


@pytest.mark.parametrize("kind", MODELS, ids=_name)
def test_a_model_is_frozen_strict_and_closed(kind):
    config = kind.model_config
    found = {name: config.get(name) for name in ("extra", "frozen", "strict", "allow_inf_nan")}
    assert found == {"extra": "forbid", "frozen": True, "strict": True, "allow_inf_nan": False}


def test_every_argument_can_be_named():
    """What stands behind a star must be named, what stands before a slash cannot be: none does."""
    nameless = {
        f"{_name(function)}: {item.name}"
        for function in FUNCTIONS
        for item in inspect.signature(function).parameters.values()
        if item.kind is item.POSITIONAL_ONLY
    }
    assert nameless == set()
