"""What several test processes of one session share: the first that asks builds it, others wait."""

import fcntl
from collections.abc import Callable
from pathlib import Path
from shutil import rmtree

import pytest


def built_once(
    request: pytest.FixtureRequest,
    factory: pytest.TempPathFactory,
    name: str,
    build: Callable[[Path], None],
) -> Path:
    """The folder that `build` made, in this process or in another one of the session.

    Nobody may write into it. One whose build failed is taken away and built anew by who asks next.
    """
    base = factory.getbasetemp()
    if hasattr(request.config, "workerinput"):
        base = base.parent
    folder, done = base / name, base / f"{name}.done"
    with (base / f"{name}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not done.exists():
            rmtree(folder, ignore_errors=True)
            build(folder)
            done.touch()
    return folder
