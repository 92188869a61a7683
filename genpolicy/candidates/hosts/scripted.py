"""A Python function of somebody's, of the bytes that its entry pins; only ever in a child."""

from collections.abc import Callable, Mapping
from importlib.abc import SourceLoader
from importlib.util import module_from_spec, spec_from_loader
from typing import Any

import numpy as np
from numpy.typing import NDArray

from genpolicy.errors import ConfigError, ContractError

Array = NDArray[Any]


class _Pinned(SourceLoader):
    """A module's source, as it was hashed; the file is not read a second time."""

    def __init__(self, source: bytes, path: str) -> None:
        self._source, self._path = source, path

    def get_filename(self, fullname: str) -> str:
        return self._path

    def get_data(self, path: str) -> bytes:
        if path != self._path:
            raise OSError(path)  # no bytecode beside it is used
        return self._source


def scripted_function(
    source: bytes, *, path: str, name: str
) -> Callable[[Mapping[str, Any]], Array]:
    """The function of a module, giving arrays.

    Args:
        source: Verified bytes of the module.
        path: Where they lie, for its tracebacks.
        name: Of the function.

    Raises:
        ConfigError: The module does not run, or has no such function.
    """
    spec = spec_from_loader("candidate", _Pinned(source, path))
    assert spec is not None  # a loader of source has one
    assert spec.loader is not None
    module = module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except Exception as error:  # whatever it raises is its own
        raise ConfigError(
            where=path,
            found=f"a module that ends with {type(error).__name__}: {str(error)[:120]}",
            expected="one that can be imported; what lies beside it is not found",
            action="Put everything into this file, or install what it imports.",
        ) from error
    function = getattr(module, name, None)
    if not callable(function):
        raise ConfigError(
            where=path,
            found=f"a module without the function {name}",
            expected="`function: module:name` of the entry",
            action="Name a function of the module.",
        )

    def called(given: Mapping[str, Any]) -> Array:
        found = np.asarray(function(dict(given)))
        if found.dtype.kind not in "fiu":
            raise ContractError(
                where=f"the answer of {name}",
                found=f"of type {found.dtype}",
                expected="numbers",
                action="Return an array of a chunk.",
            )
        return found

    return called
