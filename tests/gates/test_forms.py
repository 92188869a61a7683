"""The form of what the gates pass on: nobody writes into it, and its numbers are known.

Asked of every class and function of `gates` at once. A verdict that could be written over after it
was judged, or settings that take `yes` for 1.0, would be wrong in one place; here they are in none.
"""

import dis
import importlib
import inspect
import pkgutil
from collections.abc import Iterator
from dataclasses import FrozenInstanceError, fields, is_dataclass
from types import CodeType, FunctionType

import pytest
from as_told import hold
from held import forms, name_of
from pydantic import BaseModel

import gates
from gates.criterion import Criterion

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
CRITERIA = [
    item for module in MODULES for item in vars(module).values() if isinstance(item, Criterion)
]


def test_there_are_classes_and_functions_to_ask():
    assert len(DATA) > 30 and len(MODELS) > 10 and len(FUNCTIONS) > 500


@pytest.mark.parametrize("kind", DATA, ids=name_of)
def test_nobody_writes_into_a_value_of_the_gates(kind):
    empty = object.__new__(kind)
    with pytest.raises(FrozenInstanceError):
        setattr(empty, (fields(kind) or [None])[0].name, None)


@pytest.mark.parametrize("kind", MODELS, ids=name_of)
def test_a_model_is_frozen_strict_and_closed(kind):
    config = kind.model_config
    found = {name: config.get(name) for name in ("extra", "frozen", "strict", "allow_inf_nan")}
    assert found == {"extra": "forbid", "frozen": True, "strict": True, "allow_inf_nan": False}


def test_every_argument_can_be_named():
    """What stands behind a star must be named, what stands before a slash cannot be: none does."""
    nameless = {
        f"{name_of(function)}: {item.name}"
        for function in FUNCTIONS
        for item in inspect.signature(function).parameters.values()
        if item.kind is item.POSITIONAL_ONLY
    }
    assert nameless == set()


def _codes(code: CodeType) -> Iterator[CodeType]:
    yield code
    for inner in code.co_consts:
        if isinstance(inner, CodeType):
            yield from _codes(inner)


def _pairings(code: CodeType) -> list[object]:
    """What `strict` is in each call with an argument of that name, of a function's own code."""
    steps = list(dis.get_instructions(code))
    named = [i for i, step in enumerate(steps) if step.opname == "KW_NAMES"]
    return [steps[i - 1].argval for i in named if code.co_consts[steps[i].arg] == ("strict",)]


def test_what_is_paired_is_equally_long():
    """A pairing that drops what is left over would judge fewer rows than there are."""
    found = [
        (name_of(function), strict)
        for function in (*FUNCTIONS, *(item.measure for item in CRITERIA))
        if not function.__module__.startswith("gates.pages")
        for code in _codes(function.__code__)
        for strict in _pairings(code)
    ]
    assert len(found) > 20 and [name for name, strict in found if strict is not True] == []


def test_every_number_that_the_code_itself_holds_is_what_it_was():
    """Constants, defaults and the bounds of settings: what decides and stands in no `params.yaml`.

    A floor that protects people, a rounding, the fewest rows of a bound: one that moves is to be
    seen in a review, beside the reason for it. What pages draw with is theirs.
    """
    constants = {
        f"{module.__name__}.{name}": value
        for module in MODULES
        for name, value in vars(module).items()
        if name.isupper() and not module.__name__.startswith("gates.pages")
    }
    told = forms(constants, FUNCTIONS, DATA, MODELS)
    assert all(told.values())
    hold("forms", told)
