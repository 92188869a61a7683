"""What processes of a session share is built by one of them, and anew where that failed."""

import sys
import threading
from pathlib import Path
from types import SimpleNamespace

import pytest

sys.path.insert(0, str(Path(__file__).parents[1]))

from built_once import built_once


def asked(tmp_path, build, *, worker=None):
    """As a process of its own would ask: xdist gives each a folder inside the session's."""
    folder = tmp_path / worker if worker else tmp_path
    config = SimpleNamespace(workerinput={}) if worker else SimpleNamespace()
    request = SimpleNamespace(config=config)
    return built_once(request, SimpleNamespace(getbasetemp=lambda: folder), "made", build)


def test_one_builds_and_all_others_wait_for_it(tmp_path):
    built, found = [], []

    def build(folder):
        built.append(folder)
        folder.mkdir()
        (folder / "half").touch()
        (folder / "whole").touch()

    def ask(worker):
        made = asked(tmp_path, build, worker=worker)
        found.append((made, (made / "whole").exists()))

    for worker in ("gw0", "gw1", "gw2"):
        (tmp_path / worker).mkdir()
    threads = [threading.Thread(target=ask, args=(worker,)) for worker in ("gw0", "gw1", "gw2")]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert built == [tmp_path / "made"]
    assert found == [(tmp_path / "made", True)] * 3
    assert asked(tmp_path, build) == tmp_path / "made" and len(built) == 1


def test_what_was_left_by_a_build_that_failed_is_built_anew(tmp_path):
    def fails(folder):
        folder.mkdir()
        (folder / "half").touch()
        raise ValueError("no")

    with pytest.raises(ValueError, match="no"):
        asked(tmp_path, fails)

    def build(folder):
        folder.mkdir()
        (folder / "whole").touch()

    assert [path.name for path in asked(tmp_path, build).iterdir()] == ["whole"]
