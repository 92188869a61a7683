"""The form of what execution and feasibility pass on: nobody writes into it, its numbers are known.

Asked of every class and function of both packages at once. A verdict that could be written over
after it was judged would be wrong in one place; here it is in none.
"""

import importlib
import inspect
import pkgutil
import sys
from dataclasses import FrozenInstanceError, fields, is_dataclass
from pathlib import Path
from types import FunctionType

import pytest
from pydantic import BaseModel

import genpolicy.execution
import genpolicy.feasibility

sys.path.insert(0, str(Path(__file__).parents[1]))
from held import forms, hold, name_of

MODULES = [
    importlib.import_module(item.name)
    for package in (genpolicy.execution, genpolicy.feasibility)
    for item in pkgutil.walk_packages(package.__path__, f"{package.__name__}.")
]
OWN = [
    item
    for module in MODULES
    for item in vars(module).values()
    if getattr(item, "__module__", None) == module.__name__
]
CLASSES = [item for item in OWN if isinstance(item, type)]
DATA = [item for item in CLASSES if is_dataclass(item)]
MODELS = [item for item in CLASSES if issubclass(item, BaseModel)]
FUNCTIONS = [
    *(item for item in OWN if isinstance(item, FunctionType)),
    *(m for item in CLASSES for m in vars(item).values()
      if isinstance(m, FunctionType) and m.__module__ == item.__module__),
]  # fmt: skip
WRITTEN_INTO = {
    "genpolicy.execution.ledger.QueuedChunk", "genpolicy.feasibility.checker._State",
}  # fmt: skip
"""What counts the rows of a chunk, and what gathers margins while layers are asked."""


def test_there_are_classes_and_functions_to_ask():
    assert len(DATA) > 20 and len(MODELS) >= 2 and len(FUNCTIONS) > 200


@pytest.mark.parametrize("kind", [d for d in DATA if name_of(d) not in WRITTEN_INTO], ids=name_of)
def test_nobody_writes_into_a_value(kind):
    empty = object.__new__(kind)
    with pytest.raises((FrozenInstanceError, TypeError)):
        setattr(empty, fields(kind)[0].name, None)


@pytest.mark.parametrize("kind", MODELS, ids=name_of)
def test_settings_are_frozen_strict_and_closed(kind):
    config = kind.model_config
    found = {name: config.get(name) for name in ("extra", "frozen", "strict", "allow_inf_nan")}
    assert found == {"extra": "forbid", "frozen": True, "strict": True, "allow_inf_nan": False}


def test_every_argument_can_be_named():
    nameless = {
        f"{name_of(function)}: {item.name}"
        for function in FUNCTIONS
        for item in inspect.signature(function).parameters.values()
        if item.kind is item.POSITIONAL_ONLY and not name_of(function).endswith("__")
    }
    assert nameless == set()


def test_every_number_that_the_code_itself_holds_is_what_it_was():
    """Constants, defaults and the bounds of settings: one that moves is seen in a review."""
    constants = {
        f"{module.__name__}.{name}": value
        for module in MODULES
        for name, value in vars(module).items()
        if name.lstrip("_").isupper()
    }
    told = forms(constants, FUNCTIONS, DATA, MODELS)
    assert all(told.values())
    hold(Path(__file__).parent / "golden" / "forms.json", told)
