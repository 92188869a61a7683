"""A call in a process of its own, so that nothing warmed up before it."""

from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from typing import ParamSpec, TypeVar

from genpolicy.compute import forked

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")


def in_fresh_process(
    function: Callable[Arguments, Result], *args: Arguments.args, **kwargs: Arguments.kwargs
) -> Result:
    """`function(*args, **kwargs)` in a new process, which ends afterwards.

    It is forked from a server that has called nothing: imports take many times as long as all that
    is timed.

    Args:
        function: A top-level function.
        args: Its arguments.
        kwargs: Its keyword arguments.
    """
    with ProcessPoolExecutor(max_workers=1, mp_context=forked()) as pool:
        return pool.submit(function, *args, **kwargs).result()
