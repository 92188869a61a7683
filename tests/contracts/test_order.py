"""Long files of tests begin first, nothing sorts them again, and long tests are left out."""

import gc
import os
import re
import sys
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from order import FIRST, TESTS, leave_out_long, longest_first


@dataclass
class Item:
    path: Path
    name: str = ""
    marked: str = ""

    def get_closest_marker(self, name: str) -> str | None:
        return name if name == self.marked else None


def test_every_long_file_is_there_and_named_once() -> None:
    assert len(FIRST) == len(set(FIRST))
    assert [name for name in FIRST if not (TESTS / name).is_file()] == []


def test_long_files_begin_and_the_others_keep_their_order() -> None:
    short = [Item(TESTS / "z" / "test_a.py"), Item(TESTS / "b" / "test_b.py")]
    long = [Item(TESTS / name, case) for name in FIRST for case in "yx"]
    found = [short[0], *reversed(long[:2]), *long[2:], short[1]]
    longest_first(found)
    assert found == [long[1], long[0], *long[2:], *short]


def test_pytest_is_asked_for_that_order(request) -> None:
    places = {item.path: None for item in request.session.items}
    long = [path for path in places if path.relative_to(TESTS).as_posix() in FIRST]
    assert list(places)[: len(long)] == long


def test_the_processes_take_files_in_that_order() -> None:
    """Wrong before: xdist began with files of many tests, and the longest file has one."""
    line = re.search(r"-m pytest .*--dist .*", (TESTS.parent / "Makefile").read_text())
    assert line and "--dist loadfile --no-loadscope-reorder" in line[0]


def test_what_is_marked_long_is_left_out_and_nothing_else() -> None:
    items = [Item(TESTS, name, mark) for name, mark in (("a", ""), ("b", "long"), ("c", "slow"))]
    left = leave_out_long(items)
    assert [item.name for item in left] == ["b"]
    assert [item.name for item in items] == ["a", "c"]


def test_one_command_runs_what_the_other_leaves_out(request) -> None:
    """Here it is left out, unless it is asked for; what asks for it asks for nothing else."""
    marked = [item for item in request.session.items if item.get_closest_marker("long")]
    assert bool(marked) <= ("LONG" in os.environ)
    lines = (TESTS.parent / "Makefile").read_text().splitlines()
    [long] = [line for line in lines if "-m long" in line]
    [short] = [line for line in lines if "-m pytest" in line and line != long]
    assert long.strip().startswith("@LONG=1 ") and "LONG" not in short and "-m pytest" in long


def test_what_was_collected_is_searched_for_garbage_no_more_and_what_tests_leave_is() -> None:
    assert gc.isenabled()
    assert gc.get_freeze_count() > 10_000
