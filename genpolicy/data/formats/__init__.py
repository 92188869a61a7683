"""Recordings of others to our dataset contract: one importer per layout, each refusing by name.

The entry points are imported when they are asked for, so that who only asks what lies at a path
(`genpolicy.data.formats.detect`) does not import the readers.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from genpolicy.data.formats.opening import FORMATS, open_dataset, propose
    from genpolicy.data.formats.result import Opened

__all__ = ["FORMATS", "Opened", "open_dataset", "propose"]

_HOMES = {"FORMATS": "opening", "Opened": "result", "open_dataset": "opening", "propose": "opening"}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
