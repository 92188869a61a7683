"""The shape of the code: what it counts, and the aims that hold."""

import ast
import statistics
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import pytest
from shape import (
    BEFORE,
    LEAST_MIRRORED,
    Function,
    functions_of,
    has_code,
    is_mirrored,
    main,
    shape,
)
from shape import ROOT as TREE


def test_functions_are_counted_with_decorators_and_without_self() -> None:
    source = "class A:\n    @x\n    def f(self, a, /, b, *, c):\n        def g(): ...\n"
    found = functions_of(ast.parse(source), "m.py")
    assert found == [Function("m.py:3 f", 3, 3), Function("m.py:4 g", 1, 0)]


def test_a_module_of_constants_needs_no_tests_of_its_own() -> None:
    assert not has_code(ast.parse("X = 1\nY = X + 1\nclass Row:\n    n: int\n"))
    assert has_code(ast.parse("def f(): ..."))
    assert has_code(ast.parse("class Row:\n    @property\n    def n(self): ..."))


def test_mirrors_are_found_beside_their_source() -> None:
    assert is_mirrored(TREE / "genpolicy" / "contract" / "chunk.py")
    assert is_mirrored(TREE / "genpolicy" / "doctor.py")
    assert is_mirrored(TREE / "flows" / "reproduce.py")
    assert not is_mirrored(TREE / "genpolicy" / "contract" / "absent.py")


def test_a_name_that_only_begins_alike_is_no_mirror() -> None:
    assert is_mirrored(TREE / "genpolicy" / "policies" / "samplers.py")
    assert not is_mirrored(TREE / "genpolicy" / "policies" / "sampler.py")


@pytest.mark.parametrize("package", ["contract", "audit", "execution", "feasibility"])
def test_packages_that_others_rest_on_are_mirrored_whole(package) -> None:
    assert [name for name in shape().bare if name.startswith(f"genpolicy/{package}/")] == []


def test_tests_stand_beside_the_source() -> None:
    now = shape()
    assert now.mirrored_share >= LEAST_MIRRORED
    # What only declares is left out of the count: it must stay the exception.
    inner = [name for name in now.declaring if not name.endswith("__init__.py")]
    assert len(inner) <= 0.09 * (len(now.mirrored) + len(now.bare)), inner


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
