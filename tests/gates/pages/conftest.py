"""What the tests of the figures share: whole evidence, judged once for each gate."""

import shutil
import sys
from functools import cache
from pathlib import Path

import pytest

from gates.proof import judge

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture(scope="session")
def whole(tmp_path_factory, _ladder):
    """Evidence that every gate passes on; nobody writes into it."""
    root = tmp_path_factory.mktemp("plots") / "repo"
    shutil.copytree(_ladder, root)
    return root


@pytest.fixture(scope="session")
def judged(whole):
    """The report of a gate on the whole evidence, made once."""
    return cache(lambda gate: judge(whole, gate))


@pytest.fixture
def copied(whole, tmp_path):
    """The whole evidence, to be written into."""
    shutil.copytree(whole, tmp_path / "repo")
    return tmp_path / "repo"
