"""Compilation of kernels: once per machine and version of their code, then read from a cache.

numba keeps what it compiled beside the source, but looks at the calling file alone. So the folder
is named after a hash of all kernels that lie together: an edited callee leaves no stale caller.
And nothing else names it: numba would add the path of the checkout, so that a copy or a moved one
compiled again.
"""

import functools
import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
import numpy as np
from numba.core.caching import InTreeCacheLocator
from numpy.typing import NDArray

F = TypeVar("F", bound=Callable[..., object])

ENOUGH = 16  # digits of the hash


def cache_folder(kernels: Path) -> Path:
    """Where the compiled form of the kernels of a folder lies, for their very code."""
    files = [Path(__file__), *sorted(kernels.glob("*.py"))]
    code = b"".join(path.read_bytes() for path in files)
    return kernels / "__pycache__" / f"kernels-{hashlib.sha256(code).hexdigest()[:ENOUGH]}"


_cache_folder = functools.cache(cache_folder)


class HashedFolder(InTreeCacheLocator):
    """Where numba looks for a kernel: in the folder of this very code, wherever that lies."""

    def get_cache_path(self) -> str:
        """The folder that holds what was compiled."""
        return str(_cache_folder(Path(self._py_file).parent))


# By name, as numba asks for them; the last one is for a checkout that nobody may write.
_LOCATORS = f"{__name__}.{HashedFolder.__name__},UserWideCacheLocator"


def compiled(signature: str, *, fused: bool = False) -> Callable[[F], F]:
    """Compile a kernel for arguments of this one signature; any other is refused, not compiled.

    IEEE arithmetic as written: nothing is reordered, and a division by zero is inf.

    Args:
        signature: As numba writes it.
        fused: Whether a product that is added is rounded once with the sum, where the processor
            can; otherwise nothing is contracted.
    """
    contracted = {"contract"} if fused else False

    def compile_one(function: F) -> F:
        config: Any = numba.config
        before = config.CACHE_LOCATOR_CLASSES
        if not (before or config.CACHE_DIR):  # the user's own choice goes first
            config.CACHE_LOCATOR_CLASSES = _LOCATORS
        try:
            made = numba.njit(signature, cache=True, error_model="numpy", fastmath=contracted)(
                function
            )
        finally:
            config.CACHE_LOCATOR_CLASSES = before
        return cast(F, made)

    return compile_one


def owned(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """The values as a kernel takes them: float64, writeable, row after row; a copy if need be."""
    return np.require(values, np.float64, ["C", "W"])
