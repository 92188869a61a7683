"""Every library that the product imports is declared, and every declared one is used."""

import ast
import sys
from functools import cache
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from metadata import ROOT, name_of, project

PRODUCT = ("genpolicy", "gates", "stages", "flows")
SUPPORT = ("tests", "benchmarks")
EXTRAS = ("zarr", "hdf5", "onnx", "rerun")
NOT_IMPORTED = {
    "onnxscript": "torch.onnx writes with it",
    "fastapi": "not ours: the bound keeps Prefect's server alive, see the comment there",
}
# Its wheel installs below a prefix of its own, where the metadata of modules do not look.
# Those of `mutation` and `rerun` need not be installed.
INSTALLED_BY = {
    "pinocchio": {"pin"}, "cosmic_ray": {"cosmic-ray"}, "rerun": {"rerun-sdk"},
}  # fmt: skip


@cache
def imported(*folders: str) -> dict[str, set[str]]:
    """Files by the top-level module that they import, standard library and own code apart."""
    found: dict[str, set[str]] = {}
    for folder in folders:
        own = {*PRODUCT, *SUPPORT}
        if folder in SUPPORT:  # helpers and task of the tests are found by their bare names
            own |= {path.stem for path in (ROOT / "tests").rglob("*.py")} - {"mcap"}
            own |= {path.parent.name for path in (ROOT / "tests").glob("*/*/__init__.py")}
        for path in (ROOT / folder).rglob("*.py"):
            for name in top_level(path.read_text()):
                if name not in sys.stdlib_module_names and name not in own:
                    found.setdefault(name, set()).add(path.relative_to(ROOT).as_posix())
    return found


def top_level(source: str) -> set[str]:
    """Top-level modules that a source imports, by statement or by `import_module("...")`."""
    found = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            found.add((node.module or "").split(".")[0])
        elif isinstance(node, ast.Call) and ast.unparse(node.func).endswith("import_module"):
            literal = getattr(node.args[0], "value", None) if node.args else None
            if isinstance(literal, str):
                found.add(literal.split(".")[0])
    return found


@cache
def distributions() -> dict[str, set[str]]:
    """Distributions by the top-level module that they install."""
    return INSTALLED_BY | {
        module: {name_of(name) for name in names}
        for module, names in packages_distributions().items()
    }


def declared(*extras: str) -> set[str]:
    requirements = list(project()["dependencies"])
    for extra in extras:
        requirements += project()["optional-dependencies"][extra]
    return {name_of(requirement) for requirement in requirements}


def by_chance(imports: dict[str, set[str]], allowed: set[str]) -> dict[str, list[str]]:
    """What is imported and declared nowhere."""
    return {
        module: sorted(files)
        for module, files in imports.items()
        if not distributions().get(module, {module}) & allowed
    }


def test_every_imported_library_is_a_direct_dependency() -> None:
    missing = by_chance(imported(*PRODUCT), declared(*EXTRAS))
    assert missing == {}, "declare it in pyproject.toml: it is there by chance only"


def test_what_tests_and_benchmarks_import_is_declared_for_developers() -> None:
    missing = by_chance(imported(*SUPPORT), declared(*EXTRAS, "dev", "mutation"))
    assert missing == {}, "declare it in pyproject.toml under dev"


def test_every_declared_library_is_imported_or_has_a_reason() -> None:
    modules = imported(*PRODUCT)
    used = {name for module in modules for name in distributions().get(module, {module})}
    assert declared(*EXTRAS) - used == set(NOT_IMPORTED)


def test_every_declared_library_has_its_pin() -> None:
    pins = {
        name_of(line.split("==")[0])
        for line in (ROOT / "constraints.txt").read_text().splitlines()
        if "==" in line
    }
    assert declared(*EXTRAS, "dev") - {"genpolicy"} <= pins


@pytest.mark.parametrize(
    ("source", "found"),
    [
        ("import numpy.linalg as n", {"numpy"}),
        ("def f():\n    from torch import nn", {"torch"}),
        ("from . import x", set()),
        ("importlib.import_module('zarr.core')", {"zarr"}),
        ("import_module(name)", set()),
    ],
)
def test_the_reading_of_imports(source: str, found: set[str]) -> None:
    assert top_level(source) == found
