"""Tests that wait for clocks and not for the processor, a few of a module at a time.

Their bodies begin in the order of the tests and each test is asked for its own: what one asserts
is told where it stands, as if nothing had run beside it. More at a time would keep each other's
processes from their deadlines on a machine of two cores.
"""

import inspect
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

import pytest
from arranged import linked

AT_ONCE = 3


def together(body: Callable[..., None]) -> Callable[..., None]:
    """A test with this body: it is given `root`, `standing` and the parameters of the test."""

    def test(request: pytest.FixtureRequest, sessions: dict[str, "Future[None]"], **_: Any) -> None:
        sessions[request.node.nodeid].result()

    own = inspect.signature(test).parameters
    given = inspect.signature(body).parameters
    parameters = [own["request"], own["sessions"]]
    parameters += [given[name] for name in given if name not in ("root", "standing")]
    test.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    test.__name__, test.__doc__, test.__module__ = body.__name__, body.__doc__, body.__module__
    test.body = body  # type: ignore[attr-defined]
    return test


def beginning(request, pinned, standing, tmp_path_factory) -> Iterator[dict[str, "Future[None]"]]:
    """The bodies of a module that were asked for, by the name of their test, as they run."""
    pool, begun = ThreadPoolExecutor(AT_ONCE), {}
    try:
        for item in request.session.items:
            body = getattr(item.obj, "body", None)
            if item.path == request.path and body is not None:
                given = item.callspec.params if hasattr(item, "callspec") else {}
                root = linked(pinned, tmp_path_factory.mktemp("together"))
                begun[item.nodeid] = pool.submit(body, root=root, standing=standing, **given)
        yield begun
    finally:
        pool.shutdown(cancel_futures=True)
