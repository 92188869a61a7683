"""The shape of the code: what it counts, and the aims that hold."""

import ast
import statistics
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from shape import BEFORE, Function, functions_of, has_code, is_mirrored, main, shape
from shape import ROOT as TREE


def test_functions_are_counted_with_decorators_and_without_self() -> None:
    source = "class A:\n    @x\n    def f(self, a, /, b, *, c):\n        def g(): ...\n"
    found = functions_of(ast.parse(source), "m.py")
    assert found == [Function("m.py:3 f", 3, 3), Function("m.py:4 g", 1, 0)]


def test_a_module_of_constants_needs_no_tests_of_its_own() -> None:
    assert not has_code(ast.parse("X = 1\nY = X + 1\n"))
    assert has_code(ast.parse("def f(): ..."))


def test_mirrors_are_found_beside_their_source() -> None:
    assert is_mirrored(TREE / "genpolicy" / "contract" / "chunk.py")
    assert is_mirrored(TREE / "genpolicy" / "doctor.py")
    assert is_mirrored(TREE / "flows" / "reproduce.py")
    assert not is_mirrored(TREE / "genpolicy" / "contract" / "absent.py")


def test_the_contract_package_is_mirrored_whole() -> None:
    assert [name for name in shape().bare if name.startswith("genpolicy/contract/")] == []


def test_files_and_functions_stay_small_and_few_functions_take_many_parameters() -> None:
    now = shape()
    sizes = [lines for name, lines in now.files.items() if not name.endswith("__init__.py")]
    assert statistics.median(sizes) <= 130
    assert now.longest_files() == []
    assert now.long_functions() == []
    assert len(now.wide_functions()) <= 0.01 * len(now.functions)


def test_the_table_is_printed_whatever_it_says(capsys) -> None:
    assert main(["--all"]) == 0
    printed = capsys.readouterr().out
    assert all(package in printed for package in BEFORE)
    assert "without tests beside them" in printed
