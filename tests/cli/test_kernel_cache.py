"""Kernels are compiled for a user without a home, in a checkout that takes no files."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from genpolicy.cli.kernel_cache import PLACE, find_a_place

ROOT = Path(__file__).parents[2]
SEALED = Path("/proc/self")
"""Takes no file, whoever asks."""
NO_HOME = {"HOME": "/dev/null"}


@pytest.mark.skipif(not SEALED.is_dir(), reason="no folder that takes no file")
def test_a_place_is_found_where_nothing_takes_files():
    environment = dict(NO_HOME)
    folder = find_a_place(SEALED, environment)
    assert folder == environment[PLACE] and Path(folder).is_dir()
    shutil.rmtree(folder)


@pytest.mark.skipif(not SEALED.is_dir(), reason="no folder that takes no file")
def test_no_other_place_is_named_where_there_is_one(tmp_path):
    for package, environment in (
        (tmp_path, dict(NO_HOME)),
        (SEALED, {"HOME": str(tmp_path / "new")}),
        (SEALED, {**NO_HOME, "XDG_CACHE_HOME": str(tmp_path)}),
        (SEALED, {**NO_HOME, PLACE: "mine"}),
    ):
        before = dict(environment)
        assert find_a_place(package, environment) is None and environment == before
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(not SEALED.is_dir(), reason="no folder that takes no file")
def test_the_program_compiles_there_and_leaves_nothing(tmp_path):
    """In a process of its own, since numba reads the variable once."""
    script = (
        "from pathlib import Path\n"
        "from genpolicy.cli import main\n"
        f"main.PACKAGE = Path({str(SEALED)!r})\n"
        "main.main(['--help'])\n"
        "import numba\n"
        "assert numba.config.CACHE_DIR, 'numba was not told'\n"
        "print('compiled below', numba.config.CACHE_DIR)\n"
    )
    environment = {**os.environ, **NO_HOME, "PYTHONPATH": str(ROOT), "TMPDIR": str(tmp_path)}
    for name in (PLACE, "XDG_CACHE_HOME"):
        environment.pop(name, None)
    done = subprocess.run(
        [sys.executable, "-c", script], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert f"compiled below {tmp_path}/genpolicy-kernels-" in done.stdout
    assert not list(tmp_path.glob("genpolicy-kernels-*"))
