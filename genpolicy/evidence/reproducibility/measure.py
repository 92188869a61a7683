"""A call in a process of its own, so that nothing warmed up before it."""

import multiprocessing
import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from typing import ParamSpec, TypeVar

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")

OWN = ("genpolicy.", "gates.")
"""Of these the server imports what is imported here, and with them what they import."""


def in_fresh_process(
    function: Callable[Arguments, Result], *args: Arguments.args, **kwargs: Arguments.kwargs
) -> Result:
    """`function(*args, **kwargs)` in a new process, which ends afterwards.

    It is forked from a server that has imported what is imported here, and has called none of it:
    imports take many times as long as all that is timed.

    Args:
        function: A top-level function.
        args: Its arguments.
        kwargs: Its keyword arguments.
    """
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([name for name in sys.modules if name.startswith(OWN)])
    with ProcessPoolExecutor(max_workers=1, mp_context=context) as pool:
        return pool.submit(function, *args, **kwargs).result()
