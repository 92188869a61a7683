"""No test asks whether something was fast enough: a busy machine would turn it red.

What waits, waits for an end that comes or for the end of the process that should bring it; what
hangs is ended by the limit of the whole suite (`timeout` in pyproject.toml).

A moment is what a clock says, a span lies between a moment and another, an end is so long after a
moment. All three are followed through names, attributes, lists and what functions return. How long
something took that a product's own result says (`done.seconds`) is not seen here.
"""

import ast
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest

TESTS = Path(__file__).parents[1]
CLOCKS = {
    "monotonic", "monotonic_ns", "perf_counter", "perf_counter_ns", "process_time",
    "process_time_ns", "thread_time", "thread_time_ns", "time_ns",
}  # fmt: skip
GROWS = ("append", "add", "extend", "insert")
FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda)


def _is_clock(node: ast.AST) -> bool:
    """A call of a clock; `time.time` by its module, since much else is called `time`."""
    if not isinstance(node, ast.Call):
        return False
    name = getattr(node.func, "attr", getattr(node.func, "id", ""))
    return name in CLOCKS or ast.unparse(node.func) == "time.time"


@dataclass
class Known:
    """Names and attributes that hold moments, spans and ends, as they are written."""

    moments: set[str] = field(default_factory=set)
    spans: set[str] = field(default_factory=set)
    ends: set[str] = field(default_factory=set)

    def is_moment(self, node: ast.AST) -> bool:
        """What a clock says, or a name of it."""
        return _is_clock(node) or _written(node) in self.moments

    def has_span(self, node: ast.AST) -> bool:
        """Whether anything in it is a span."""
        return any(
            _written(part) in self.spans
            or (
                isinstance(part, ast.BinOp)
                and isinstance(part.op, ast.Sub)
                and self.is_moment(part.left)
            )
            for part in ast.walk(node)
        )

    def has_end(self, node: ast.AST) -> bool:
        """Whether anything in it is so long after a moment."""
        return any(
            _written(part) in self.ends
            or (
                isinstance(part, ast.BinOp)
                and isinstance(part.op, ast.Add)
                and (self.is_moment(part.left) or self.is_moment(part.right))
            )
            for part in ast.walk(node)
        )

    def learn(self, name: str, value: ast.AST) -> None:
        """What a name holds from here on."""
        if self.has_span(value):
            self.spans.add(name)
        elif self.has_end(value):
            self.ends.add(name)
        elif self.is_moment(value):
            self.moments.add(name)

    @property
    def size(self) -> int:
        """How much is known."""
        return len(self.moments) + len(self.spans) + len(self.ends)


def _written(node: ast.AST) -> str:
    """A name or an attribute as it is written; of a place in a container, the container."""
    while isinstance(node, ast.Subscript | ast.Starred):
        node = node.value
    return ast.unparse(node) if isinstance(node, ast.Name | ast.Attribute) else ""


def _given(node: ast.AST) -> Iterator[tuple[str, ast.AST]]:
    """Names that a statement or an expression gives a value, with the value."""
    if isinstance(node, ast.Assign):
        for target in node.targets:
            yield from _each(target, node.value)
    elif isinstance(node, ast.AnnAssign | ast.AugAssign | ast.NamedExpr) and node.value:
        yield from _each(node.target, node.value)
    elif isinstance(node, ast.For | ast.comprehension):
        yield from _each(node.target, node.iter)
    elif isinstance(node, ast.FunctionDef):
        for part in ast.walk(node):
            if isinstance(part, ast.Return) and part.value:
                yield node.name, part.value
    elif (
        isinstance(node, ast.Call)
        and isinstance(node.func, ast.Attribute)
        and node.func.attr in GROWS
    ):
        yield from ((_written(node.func.value), value) for value in node.args)


def _each(target: ast.AST, value: ast.AST) -> Iterator[tuple[str, ast.AST]]:
    """Several names take one value each, or all of them what they are taken from."""
    if not isinstance(target, ast.Tuple | ast.List):
        yield _written(target), value
        return
    values = value.elts if isinstance(value, ast.Tuple | ast.List) else []
    same = len(values) == len(target.elts)
    for part, own in zip(target.elts, values if same else [value] * len(target.elts), strict=True):
        yield from _each(part, own)


def _scopes(tree: ast.Module) -> Iterator[tuple[list[ast.AST], Known]]:
    """Each outermost function, and all that stands outside of any, with what is known there.

    What a module knows is known in its functions: names outside of them, attributes, what they
    return. Names inside one are its own.
    """
    inner = [node for node in _outside(tree) if isinstance(node, FUNCTIONS)]
    outer = [node for node in _outside(tree) if not isinstance(node, FUNCTIONS)]
    shared = _learnt(outer, Known())
    own = []
    while True:
        own = [_learnt(list(ast.walk(part)), shared) for part in inner]
        before = shared.size
        for part, known in zip(inner, own, strict=True):
            name = getattr(part, "name", "")
            for kind in ("moments", "spans", "ends"):
                told = getattr(known, kind)
                getattr(shared, kind).update(n for n in told if "." in n or n == name)
        if shared.size == before:
            break
    yield outer, shared
    yield from ((list(ast.walk(part)), known) for part, known in zip(inner, own, strict=True))


def _outside(node: ast.AST) -> Iterator[ast.AST]:
    """All below a node, and functions, but nothing inside of them."""
    for child in ast.iter_child_nodes(node):
        yield child
        if not isinstance(child, FUNCTIONS):
            yield from _outside(child)


def _learnt(nodes: list[ast.AST], shared: Known) -> Known:
    """What is known after reading these nodes, in whatever order they run."""
    known = Known(set(shared.moments), set(shared.spans), set(shared.ends))
    before = -1
    while known.size != before:
        before = known.size
        for node in nodes:
            for name, value in _given(node):
                if name:
                    known.learn(name, value)
    return known


def _asks(early: ast.AST, late: ast.AST, known: Known) -> bool:
    """Whether it must be early: a clock called there, a span, or a moment before an end."""
    called = any(_is_clock(part) for part in ast.walk(early))
    return called or known.has_span(early) or (known.is_moment(early) and known.has_end(late))


def too_late(text: str) -> list[int]:
    """Lines on which a clock is asked whether it is still early."""
    found = set()
    for nodes, known in _scopes(ast.parse(text)):
        for node in nodes:
            if not isinstance(node, ast.Compare):
                continue
            sides = [node.left, *node.comparators]
            for left, op, right in zip(sides, node.ops, sides[1:], strict=False):
                if isinstance(op, ast.Lt | ast.LtE) and _asks(left, right, known):
                    found.add(node.lineno)
                if isinstance(op, ast.Gt | ast.GtE) and _asks(right, left, known):
                    found.add(node.lineno)
    return sorted(found)


ASKS = [
    "assert time.monotonic() < deadline",
    "while waits() and time.perf_counter() - begun <= 5:\n    pass",
    "assert 2.0 > monotonic() - begun",
    "assert 0 < time.time() - begun < 5",
    "t = monotonic() - begun\nassert t < 5",
    "def test():\n    begun = monotonic()\n    work()\n    took = monotonic() - begun\n"
    "    assert took < 5",
    "def test():\n    begun = monotonic()\n    end = monotonic()\n    assert end - begun < 5",
    "def test():\n    took: float = monotonic() - begun\n    assert 0.0 <= took <= 5",
    "def test():\n    took = round(1e3 * (monotonic() - begun))\n    assert 5 > took",
    "def test():\n    assert (took := monotonic() - begun) > 0\n    assert took < 5",
    "def test():\n    total = 0\n    total += monotonic() - begun\n    assert total / 3 < 5",
    "def test():\n    end = monotonic() + 5\n    now = monotonic()\n    assert now < end",
    "def test():\n    begun, last = monotonic(), 5\n    assert monotonic() - begun < last",
    "def test():\n    all = []\n    all.append(monotonic() - begun)\n    assert max(all) < 5",
    "def test():\n    of = {}\n    of['a'] = monotonic() - begun\n    assert of['a'] < 5",
    "def test():\n    all = [monotonic() - t for t in at]\n    for one in all:\n"
    "        assert one < 5",
    "class Run:\n    def end(self):\n        self.took = monotonic() - self.begun\n"
    "    def test(self):\n        assert self.took < 5",
    "def took():\n    return monotonic() - begun\ndef test():\n    assert took() < 5",
    "def test():\n    def inner():\n        begun = perf_counter_ns()\n"
    "        took = perf_counter_ns() - begun\n        assert took < 5\n    inner()",
]
DOES_NOT = [
    "assert time.monotonic() - begun >= 0.3",
    "assert done.seconds > 0.0",
    "took = monotonic() - begun\nassert took >= 0.3",
    "took = monotonic() - begun\nprint(took)\nassert steps < 5",
    "def test():\n    before = monotonic()\n    made = make()\n    assert before <= made.at_s",
    "def test():\n    t = monotonic() - begun\n    print(t)\ndef other():\n    t = 3\n"
    "    assert t < 5",
    "def test(clock):\n    t = clock.now_s - begun\n    assert t < 5",
    "def test():\n    margin = limit - value\n    assert margin < 5",
    "record.time()\nassert frame.time() < 5",
]


@pytest.mark.parametrize("text", ASKS)
def test_golden_what_asks_for_speed(text: str) -> None:
    lines = enumerate(text.splitlines(), 1)
    asks = [number for number, line in lines if line.strip().startswith(("assert", "while"))]
    assert too_late(text) == asks[-1:]


@pytest.mark.parametrize("text", DOES_NOT)
def test_golden_what_does_not(text: str) -> None:
    assert too_late(text) == []


def test_no_test_holds_a_clock_against_a_limit() -> None:
    files = sorted(TESTS.rglob("*.py"))
    assert len(files) > 200
    found = [f"{p.relative_to(TESTS)}:{n}" for p in files for n in too_late(p.read_text())]
    assert found == []
