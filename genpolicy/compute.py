"""Fan-out of independent shards: local processes by default, a Dask cluster by address.

The local scheduler is Dask's own process pool: it needs no network. Results come back in the order
of the shards, whatever finishes first.
"""

import multiprocessing
import sys
from collections.abc import Callable, Sequence
from multiprocessing.context import ForkServerContext
from typing import Any, Literal, TypeVar

from dask import config
from dask.base import compute as compute_local
from dask.delayed import delayed

Shard = TypeVar("Shard")
Result = TypeVar("Result")

LOCAL = "local"
FORKED: Literal["forkserver"] = "forkserver"
OWN = ("genpolicy.", "gates.")
"""Of these the server imports what is imported here, and with them what they import."""


def forked() -> ForkServerContext:
    """Processes that are forked from a server, which has imported what is imported here.

    It has called none of it, so that nothing is warm in them; importing takes many times as long as
    most of what they do.
    """
    context = multiprocessing.get_context(FORKED)
    context.set_forkserver_preload([name for name in sys.modules if name.startswith(OWN)])
    return context


def map_shards(
    function: Callable[[Shard], Result],
    shards: Sequence[Shard],
    *,
    workers: int,
    scheduler: str,
) -> list[Result]:
    """`[function(shard) for shard in shards]`, spread over processes.

    Args:
        function: A top-level function; it must not depend on the process that it runs in.
        shards: Its arguments, one call each.
        workers: Local processes; 1 runs everything in this process.
        scheduler: `local`, or the address of a Dask scheduler.

    Returns:
        One result per shard, in order.
    """
    if scheduler == LOCAL and (workers == 1 or len(shards) < 2):
        return [function(shard) for shard in shards]
    tasks: list[Any] = [delayed(function, pure=False)(shard) for shard in shards]
    run_local: Any = compute_local
    if scheduler == LOCAL:
        forked()  # names what the server imports; Dask asks for the same context by its name
        with config.set({"multiprocessing.context": FORKED}):
            return list(run_local(*tasks, scheduler="processes", num_workers=workers, chunksize=1))
    from distributed import Client  # noqa: PLC0415  (slow import, only with a cluster)

    connect: Any = Client
    with connect(scheduler) as client:
        return list(client.gather(client.compute(tasks)))
