"""One finished ladder per session, by a real `dvc repro`, and a copy of it for each test."""

import sys
from collections.abc import Iterator
from pathlib import Path
from shutil import rmtree

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from _beside import BESIDE
from built_once import built_once
from ladder_workspace import ALWAYS_RUN, copy_of, make_small_ladder, repro

from stages._stage import STAGES


@pytest.fixture(scope="session")
def finished(tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest) -> Path:
    """A workspace whose ladder ran from recordings to the draft of the card.

    Processes of one parallel session share it: the first builds it, the others wait.
    """

    def build(workspace: Path) -> None:
        outcome, ran = repro(make_small_ladder(workspace))
        assert outcome.code == 0, outcome.sentence
        assert (ran[0], ran[-1], len(ran)) == (
            "record",
            "gate_e",
            len(STAGES) + len(BESIDE) - len(ALWAYS_RUN),
        )

    return built_once(request, tmp_path_factory, "finished-ladder", build)


@pytest.fixture
def copy(finished: Path, tmp_path: Path) -> Iterator[Path]:
    """An independent copy of the finished workspace."""
    yield copy_of(finished, tmp_path / "copy")
    rmtree(tmp_path / "copy", ignore_errors=True)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The first test waits for the whole small ladder, which a busy machine makes slow."""
    for item in items:
        if Path(__file__).parent in item.path.parents:
            item.add_marker(pytest.mark.timeout(3600))
