"""No test asks whether something was fast enough: a busy machine would turn it red.

What waits, waits for an end that comes or for the end of the process that should bring it; what
hangs is ended by the limit of the whole suite (`timeout` in pyproject.toml).
"""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

TESTS = Path(__file__).parents[1]
CLOCKS = ("monotonic", "perf_counter", "process_time", "monotonic_ns", "perf_counter_ns")


def _reads_a_clock(node: ast.expr) -> bool:
    return any(
        isinstance(part, ast.Call)
        and getattr(part.func, "attr", getattr(part.func, "id", "")) in CLOCKS
        for part in ast.walk(node)
    )


def too_late(text: str) -> Iterator[int]:
    """Lines on which a clock is asked whether it is still early."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Compare) and len(node.ops) == 1:
            early, late = (ast.Lt, ast.LtE), (ast.Gt, ast.GtE)
            if (isinstance(node.ops[0], early) and _reads_a_clock(node.left)) or (
                isinstance(node.ops[0], late) and _reads_a_clock(node.comparators[0])
            ):
                yield node.lineno


@pytest.mark.parametrize(
    ("text", "lines"),
    [
        ("assert time.monotonic() < deadline", [1]),
        ("while waits() and time.perf_counter() - begun <= 5:\n    pass", [1]),
        ("assert 2.0 > monotonic() - begun", [1]),
        ("assert time.monotonic() - begun >= 0.3", []),
        ("assert done.seconds > 0.0", []),
    ],
)
def test_golden_what_asks_for_speed(text: str, lines: list[int]) -> None:
    assert list(too_late(text)) == lines


def test_no_test_holds_a_clock_against_a_limit() -> None:
    files = sorted(TESTS.rglob("*.py"))
    assert len(files) > 200
    found = [f"{p.relative_to(TESTS)}:{n}" for p in files for n in too_late(p.read_text())]
    assert found == []
