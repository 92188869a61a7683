"""One finished ladder per session, by a real `dvc repro`, and a copy of it for each test."""

import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from shutil import rmtree

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from ladder_workspace import copy_of, make_small_ladder, repro


@pytest.fixture(scope="session")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A workspace whose ladder ran from recordings to the draft of the card."""
    workspace = make_small_ladder(tmp_path_factory.mktemp("ladder") / "finished")
    outcome, ran = repro(workspace)
    assert outcome.code == 0, outcome.sentence
    assert (ran[0], ran[-1], len(ran)) == ("record", "gate_e", 15)
    return workspace


@pytest.fixture
def copy(finished: Path, tmp_path: Path) -> Iterator[Path]:
    """An independent copy of the finished workspace."""
    yield copy_of(finished, tmp_path / "copy")
    rmtree(tmp_path / "copy", ignore_errors=True)


@pytest.fixture(scope="module")
def copies(
    finished: Path, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Callable[[str], Path]]:
    """Copies of the finished workspace by name, for tests that share one."""
    base = tmp_path_factory.mktemp("copies")
    yield lambda name: copy_of(finished, base / name)
    rmtree(base, ignore_errors=True)
