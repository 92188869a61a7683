"""Commands are found by entry points; here by those of the tree, whatever is installed."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "contracts"))

from metadata import write_metadata


@pytest.fixture(scope="session")
def metadata(tmp_path_factory):
    return write_metadata(tmp_path_factory.mktemp("metadata"))


@pytest.fixture(autouse=True)
def entry_points_of_the_tree(metadata, monkeypatch):
    monkeypatch.syspath_prepend(str(metadata))
