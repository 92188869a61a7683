"""Where compiled kernels may lie if neither the checkout nor the home of the user takes files.

numba refuses to compile what it can keep nowhere. Whoever verifies a bundle may well be a user
without a home, in a checkout that belongs to somebody else: then they lie in a folder of this
process, and go with it.
"""

import atexit
import os
import shutil
import tempfile
from collections.abc import MutableMapping
from pathlib import Path

PLACE = "NUMBA_CACHE_DIR"
"""By this variable a user names a place, and processes that are started inherit it."""


def find_a_place(package: Path, environment: MutableMapping[str, str]) -> str | None:
    """Name a new temporary folder in the environment where kernels could be kept nowhere else.

    To be called before numba is imported.

    Args:
        package: Folder of the kernels' source.
        environment: Variables of the process.

    Returns:
        The folder, removed when the process ends; None where there is another place.
    """
    home = environment.get("HOME") or os.path.expanduser("~")
    users = Path(environment.get("XDG_CACHE_HOME") or Path(home) / ".cache")
    if environment.get(PLACE) or any(map(_takes_files, (package, users))):
        return None
    folder = tempfile.mkdtemp(prefix="genpolicy-kernels-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    environment[PLACE] = folder
    return folder


def _takes_files(folder: Path) -> bool:
    """Whether a file can be made in a folder, or in the nearest above it that there is."""
    while not folder.exists() and folder != folder.parent:
        folder = folder.parent
    try:
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False
