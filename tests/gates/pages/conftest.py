"""What the tests of the figures share: whole evidence."""

import shutil
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture(scope="session")
def whole(tmp_path_factory, _ladder):
    """Evidence that every gate passes on; nobody writes into it."""
    root = tmp_path_factory.mktemp("plots") / "repo"
    shutil.copytree(_ladder, root)
    return root


@pytest.fixture
def copied(whole, tmp_path):
    """The whole evidence, to be written into."""
    shutil.copytree(whole, tmp_path / "repo")
    return tmp_path / "repo"
