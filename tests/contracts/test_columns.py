"""A column of evidence that a gate, a page or an evidence stage names is a field of some row.

A table refuses unknown and missing columns when it is read, but a misspelt literal behind that is
found only where its line runs. So every literal by which a frame is indexed is held against the
fields of the row classes; a column that the same file makes itself counts as well.
"""

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
READERS = ("gates", "genpolicy/pages", "genpolicy/evidence")
ROWS = (
    "genpolicy/audit/component_rows.py", "genpolicy/audit/hidden_rows.py",
    "genpolicy/audit/reach_rows.py", "genpolicy/audit/rows.py", "genpolicy/audit/shown_rows.py",
    "genpolicy/data/rows.py", "genpolicy/evidence/rows", "genpolicy/policies/validation_row.py",
)  # fmt: skip
# What is indexed by name and is no frame, and what it is instead.
NO_FRAMES = {
    "document": "a JSON document",
    "settings": "settings as a document",
    "report.settings": "the same, of a report",
    "evidence": "tables by name",
    "limits": "limits by question",
    "found": "entries of a document, or settings by owner",
    "first": "an error of pydantic, or an obstacle of a document",
    "entry": "an entry of a document",
    "item": "the same",
    "row": "a limit or an epoch of a page, or one row of a frame that is checked where it is read",
    "record": "a record of times",
    "names": "a namespace",
    "payload": "an event of a journal",
    "runs": "the regime of the arithmetic, by name",
    "config.parameters": "counts of parameters by part",
    "manifest": "a JSON document",
    "reports": "reports by gate",
    "chain.reports": "the same",
    "dataset.manifest": "a JSON document",
    "event.payload": "an event of a journal",
    "error.errors()[0]": "an error of pydantic",
    "Literal": "a type",
    "NAMES": "names of gates by letter",
    "rows_by_gate": "rows of a gate, by its letter",
    "self.operations": "operations of a network by part",
    "cost.operations": "the same",
}
# A column that a library makes: (file, column).
MADE = {
    ("genpolicy/pages/figures/checks.py", "size"): "pandas: `agg` names it so",
    ("genpolicy/pages/figures/checks.py", "sum"): "the same",
    ("gates/pages/plots_convergence.py", "total"): "made in `gates.reproducibility.convergence`",
    ("gates/reproducibility/matching.py", "total"): "the same",
    ("gates/pages/plots_density.py", "gain"): "made in `gates.reproducibility.densities`",
    ("gates/pages/plots_density.py", "share"): "the same",
    ("gates/pages/tables_survival.py", "broken"): "a place of the table: no frame, sums by place",
    ("gates/pages/tables_survival.py", "held"): "the same",
    ("gates/pages/tables_survival.py", "way"): "the same",
    ("gates/pages/plots_convergence.py", "color"): "a keyword of matplotlib's lines",
    ("gates/pages/tables_severity.py", "color"): "the same",
    ("gates/reproducibility/files.py", "name"): "a setting of the sampler",
    ("gates/reproducibility/fixtures.py", "checkpoint"): "a column of what training drew",
    ("gates/reproducibility/weights.py", "data"): "a key of a tensor, as safetensors says it",
    ("gates/reproducibility/weights.py", "dtype"): "the same",
}
# Methods of a frame that take names of columns, and functions that take one after the frame.
METHODS = {"groupby", "sort_values", "drop_duplicates", "set_index", "pivot", "dropna"}
FUNCTIONS = {"numbers", "flags"}


@cache
def fields() -> frozenset[str]:
    """Every column of every table."""
    files = [
        path for name in ROWS for path in (sorted((ROOT / name).glob("*.py")) or [ROOT / name])
    ]
    return frozenset(
        part.target.id
        for path in files
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.ClassDef)
        for part in node.body
        if isinstance(part, ast.AnnAssign) and isinstance(part.target, ast.Name)
    )


def texts(node: ast.expr) -> set[str]:
    """The text that a node is, or those that its list or tuple holds."""
    parts = node.elts if isinstance(node, ast.List | ast.Tuple) else [node]
    return {p.value for p in parts if isinstance(p, ast.Constant) and isinstance(p.value, str)}


def made(tree: ast.AST) -> set[str]:
    """Columns that a module makes: by `assign`, by a name for what is aggregated, by storing."""
    found: set[str] = set()
    for node in ast.walk(tree):
        match node:
            case ast.Subscript(ctx=ast.Store(), slice=name):
                found |= texts(name)
            case ast.Call(func=ast.Attribute(attr="assign" | "agg" | "rename" | "DataFrame")):
                found |= {keyword.arg for keyword in node.keywords if keyword.arg}
                tables = [part for part in ast.walk(node) if isinstance(part, ast.Dict)]
                found |= {
                    name for part in tables for key in part.keys if key for name in texts(key)
                }
    return found


def named(tree: ast.AST) -> Iterator[tuple[str, set[str]]]:
    """What is indexed, and by which literals."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Subscript) and isinstance(node.ctx, ast.Load):
            yield ast.unparse(node.value), texts(node.slice)
        elif isinstance(node, ast.Call):
            function = node.func
            if isinstance(function, ast.Attribute) and function.attr in METHODS and node.args:
                yield ast.unparse(function.value), texts(node.args[0])
            elif isinstance(function, ast.Name) and function.id in FUNCTIONS:
                for argument in node.args[1:2]:
                    yield ast.unparse(node.args[0]), texts(argument)


def unknown(source: str, columns: frozenset[str]) -> set[str]:
    """Literal columns of frames that are no field of a row and that the module does not make."""
    tree = ast.parse(source)
    known = columns | made(tree)
    return {
        column
        for what, literals in named(tree)
        if what not in NO_FRAMES
        for column in literals - known
    }


@cache
def found() -> frozenset[tuple[str, str]]:
    return frozenset(
        (path.relative_to(ROOT).as_posix(), column)
        for folder in READERS
        for path in sorted((ROOT / folder).rglob("*.py"))
        for column in unknown(path.read_text(), fields())
    )


def test_every_column_that_is_named_is_a_field_of_some_row() -> None:
    assert {"told_upper", "mean_admissible", "force_peak_n", "loss"} <= fields()
    assert sorted(found() - set(MADE)) == []


def test_no_exception_outlives_its_need() -> None:
    assert sorted(set(MADE) - found()) == []
    indexed = {
        what
        for folder in READERS
        for path in (ROOT / folder).rglob("*.py")
        for what, literals in named(ast.parse(path.read_text()))
        if literals
    }
    assert sorted(set(NO_FRAMES) - indexed) == []


@pytest.mark.parametrize(
    "line",
    ["frame['methdo']", "frame[['method', 'methdo']]", "numbers(rows, 'methdo')",
     "frame.groupby('methdo')", "frame.sort_values(['methdo'])", "frame[frame['methdo'] == 1]",
     "evidence['modes']['methdo']"],
)  # fmt: skip
def test_a_misspelt_column_is_found(line: str) -> None:
    assert unknown(line, frozenset({"method"})) == {"methdo"}


@pytest.mark.parametrize(
    "source",
    ["frame['method']", "document['methdo']", "f = frame.assign(methdo=1)\nf['methdo']",
     "frame['methdo'] = 1\nframe['methdo']", "g.agg(methdo=('method', 'sum'))['methdo']"],
)  # fmt: skip
def test_documents_and_columns_of_its_own_are_left_alone(source: str) -> None:
    assert unknown(source, frozenset({"method"})) == set()
