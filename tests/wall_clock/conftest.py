"""Runs of real processes: an arm that stands still, and policies that behave in every bad way."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from arranged import still_replay, workspace
from together import beginning
from told import begin

from genpolicy.tasks.api import load_task


@pytest.fixture(scope="session")
def standing():
    """A replay of thirty rows in which nothing moves."""
    return still_replay(load_task("tabletop_insertion"), rows=30)


@pytest.fixture(scope="session")
def pinned(tmp_path_factory):
    """A workspace with slow limits, pinned: a busy machine must not decide a test."""
    return workspace(tmp_path_factory.mktemp("pinned"))


@pytest.fixture(scope="module")
def sessions(request, pinned, standing, tmp_path_factory):
    """What runs of the tests that are marked `together`."""
    yield from beginning(request, pinned, standing, tmp_path_factory)


@pytest.fixture
def told(kit, task, checker, standing, tmp_path):
    """A session on an arm that stands; nobody has asked anything."""
    return begin(kit, task, checker, standing, tmp_path)
