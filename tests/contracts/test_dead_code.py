"""Public definitions that no line of the product names: code that only its tests know.

`python tests/contracts/test_dead_code.py` lists them.
"""

import ast
import re
import sys
import tomllib
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PRODUCT = ("genpolicy", "gates", "stages", "flows", "benchmarks")
WORD = re.compile(r"[A-Za-z_]\w*")

# Definition: why nothing of ours names it. An entry that is named, or gone, is an error too.
READS_BACK = "reads what the product writes, for whoever audits a run"
ALLOWED: dict[str, str] = {
    "genpolicy.execution.journal:decode_actions": READS_BACK,
    "genpolicy.execution.journal:read_journal": READS_BACK,
    "genpolicy.execution.recovery:Recovery.human_resolved": (
        "the way out of `ask_human`: a person's, so nothing of ours may take it"
    ),
    "genpolicy.robot.collision:CollisionModel.in_collision": (
        "for the worlds of tasks outside the tree; the one of the tests asks it at every tick"
    ),
}


def definitions(source: str) -> Iterator[tuple[str, str]]:
    """Name and dotted place of each public function, class, method and constant of a module."""
    for node in ast.parse(source).body:
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            if node.name.startswith("_"):
                continue
            yield node.name, node.name
            if isinstance(node, ast.ClassDef):
                for part in node.body:
                    method = isinstance(part, ast.FunctionDef | ast.AsyncFunctionDef)
                    if method and not part.name.startswith("_") and not _hooks(part):
                        yield part.name, f"{node.name}.{part.name}"
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            for target in targets:
                names = target.elts if isinstance(target, ast.Tuple) else [target]
                for name in names:
                    if isinstance(name, ast.Name) and not name.id.startswith("_"):
                        yield name.id, name.id


def _hooks(function: ast.FunctionDef | ast.AsyncFunctionDef) -> bool:
    """Whether a decorator hands the function to a library, which then calls it by itself."""
    hooks = ("validator", "field_serializer", "model_serializer")
    return any(ast.unparse(d).split("(")[0].endswith(hooks) for d in function.decorator_list)


def uses(source: str) -> set[str]:
    """Every name that a module reads: variables, attributes, keywords and words in short texts."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Name) and not isinstance(node.ctx, ast.Store):
            found.add(node.id)
        elif isinstance(node, ast.Attribute):
            found.add(node.attr)
        elif isinstance(node, ast.keyword) and node.arg:
            found.add(node.arg)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            words = node.value.split()
            if len(words) == 1:  # a name or a reference to one
                found |= set(WORD.findall(words[0]))
    return found


def registered(source: str) -> set[str]:
    """Functions that a decorator takes, other than one that only wraps: they are called by it."""
    plain = {"property", "staticmethod", "classmethod", "dataclass", "cached_property", "cache",
             "lru_cache", "override", "contextmanager", "abstractmethod", "total_ordering",
             "runtime_checkable", "wraps", "jit", "no_grad", "inference_mode"}  # fmt: skip
    found = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            for decorator in node.decorator_list:
                name = ast.unparse(decorator).split("(")[0].split(".")[-1]
                if name not in plain:
                    found.add(node.name)
    return found


@cache
def named() -> set[str]:
    """Every name that a line of the product reads, templates and entry points included."""
    found: set[str] = set()
    for folder in PRODUCT:
        for path in (ROOT / folder).rglob("*.py"):
            text = path.read_text()
            found |= uses(text) | registered(text)
        for path in (ROOT / folder).rglob("*.html"):
            found |= set(WORD.findall(path.read_text()))
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    points = [*project["scripts"].values()]
    for group in project["entry-points"].values():
        points += group.values()
    return found | {point.split(":")[1] for point in points}


def dead() -> list[str]:
    """Places of public definitions that no line of the product names."""
    found = []
    for folder in PRODUCT:
        if folder == "benchmarks":
            continue
        for path in sorted((ROOT / folder).rglob("*.py")):
            module = path.relative_to(ROOT).with_suffix("").as_posix().replace("/", ".")
            found += [
                f"{module}:{place}"
                for name, place in definitions(path.read_text())
                if name not in named()
            ]
    return found


def test_every_public_definition_is_named_by_the_product() -> None:
    new = sorted(set(dead()) - set(ALLOWED))
    assert new == [], "wire it, remove it, or allow it with a reason"


def test_every_allowed_definition_is_still_there_and_still_not_named() -> None:
    assert sorted(set(ALLOWED) - set(dead())) == []
    assert all(reason.strip() for reason in ALLOWED.values())


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        ("def f(): ...\ndef _g(): ...", ["f"]),
        ("class A:\n    x: int = 1\n    def m(self): ...\n    def _n(self): ...", ["A", "A.m"]),
        ("A, B = 1, 2\nC: int = 3\n_D = 4", ["A", "B", "C"]),
        ("class A:\n    @model_validator(mode='after')\n    def m(self): ...", ["A"]),
    ],
)
def test_definitions_are_found(source: str, expected: list[str]) -> None:
    assert [place for _, place in definitions(source)] == expected


def test_what_counts_as_a_use() -> None:
    assert {"f", "x", "k", "K"} <= uses("f(x.y, k=1)\nt: 'K' = 2")
    assert "f" not in uses("def f(): ...\nfrom m import f")
    assert "prose" not in uses("'''Some prose about it.'''")
    assert registered("@app.command()\ndef f(): ...\n@property\ndef g(): ...") == {"f"}


if __name__ == "__main__":
    sys.stdout.write("\n".join([*dead(), ""]))
