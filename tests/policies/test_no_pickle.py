"""Nothing in the tree loads objects from files: no torch.load, no pickle, no numpy pickles."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FORBIDDEN_MODULES = {"pickle", "cPickle", "dill", "cloudpickle", "joblib", "shelve", "marshal"}
FORBIDDEN_CALLS = {("torch", "load"), ("torch", "save"), ("pd", "read_pickle"), ("torch", "jit")}
SOURCES = sorted(
    path
    for folder in ("genpolicy", "gates", "stages", "flows")
    for path in (ROOT / folder).rglob("*.py")
)


def offences(tree: ast.AST) -> list[str]:
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found += [a.name for a in node.names if a.name.split(".")[0] in FORBIDDEN_MODULES]
        elif isinstance(node, ast.ImportFrom) and node.module:
            if node.module.split(".")[0] in FORBIDDEN_MODULES:
                found.append(node.module)
            found += [
                f"{node.module}.{a.name}"
                for a in node.names
                if (node.module, a.name) in FORBIDDEN_CALLS
            ]
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            if (node.value.id, node.attr) in FORBIDDEN_CALLS:
                found.append(f"{node.value.id}.{node.attr}")
        elif isinstance(node, ast.keyword) and node.arg == "allow_pickle":
            safe = isinstance(node.value, ast.Constant) and node.value.value is False
            found += [] if safe else ["allow_pickle"]
    return found


def test_no_source_loads_objects():
    assert len(SOURCES) > 20
    found = {
        str(path.relative_to(ROOT)): bad
        for path in SOURCES
        if (bad := offences(ast.parse(path.read_text())))
    }
    assert found == {}


@pytest.mark.parametrize(
    "text",
    ["import pickle", "from pickle import loads", "import torch\ntorch.load('x')",
     "from torch import load", "import numpy as np\nnp.load('x', allow_pickle=True)"],
)  # fmt: skip
def test_the_search_finds_what_it_is_for(text):
    assert offences(ast.parse(text))
