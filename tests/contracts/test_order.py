"""Long files of tests begin first, and nothing sorts them again."""

import re
import sys
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from order import LONG, TESTS, longest_first


@dataclass
class Item:
    path: Path
    name: str = ""


def test_every_long_file_is_there_and_named_once() -> None:
    assert len(LONG) == len(set(LONG))
    assert [name for name in LONG if not (TESTS / name).is_file()] == []


def test_long_files_begin_and_the_others_keep_their_order() -> None:
    short = [Item(TESTS / "z" / "test_a.py"), Item(TESTS / "b" / "test_b.py")]
    long = [Item(TESTS / name, case) for name in LONG for case in "yx"]
    found = [short[0], *reversed(long[:2]), *long[2:], short[1]]
    longest_first(found)
    assert found == [long[1], long[0], *long[2:], *short]


def test_pytest_is_asked_for_that_order(request) -> None:
    places = {item.path: None for item in request.session.items}
    long = [path for path in places if path.relative_to(TESTS).as_posix() in LONG]
    assert list(places)[: len(long)] == long


def test_the_processes_take_files_in_that_order() -> None:
    """Wrong before: xdist began with files of many tests, and the longest file has one."""
    line = re.search(r"-m pytest .*--dist .*", (TESTS.parent / "Makefile").read_text())
    assert line and "--dist loadfile --no-loadscope-reorder" in line[0]
