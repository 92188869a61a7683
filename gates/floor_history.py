"""Bounds of `gates/floors.py` as another commit wrote them: read as text, never run.

A bound that moved lets a limit move behind it, so that whoever asks which limits moved must hear
of it. Old code is taken apart and not imported: what a commit holds is nobody's to execute.
"""

import ast
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Literal

from gates.report import GATES, Gate

FLOORS = "gates/floors.py"
Kind = Literal["loosened", "tightened", "changed"]
NONE = "no bound"
ALWAYS_ZERO = "_counts"
"""Function whose arguments are criteria that may count nothing: gate, reason, names."""


@dataclass(frozen=True)
class Bounded:
    """How loose a setting may be at most, as a text says it.

    Attributes:
        gate: Who judges by it; of several the lowest.
        comparison: The setting must be `<=` or `>=` the bound.
        bound: The loosest value.
    """

    gate: Gate
    comparison: str
    bound: float

    def __str__(self) -> str:
        return f"{self.comparison} {self.bound:g}"


def bounds_in(source: str) -> dict[tuple[str, str], Bounded]:
    """Every bound that a text of the module states, by the gates that it is written for and place.

    Args:
        source: The text; one that is no Python states none.
    """
    try:
        tree = ast.parse(source)
    except (SyntaxError, ValueError):
        return {}
    known = {
        target.id: node.value.value
        for node in tree.body
        if isinstance(node, ast.Assign) and isinstance(node.value, ast.Constant)
        for target in node.targets
        if isinstance(target, ast.Name)
    }
    found: dict[tuple[str, str], Bounded] = {}
    for scope in tree.body:
        gates = _gates_of(scope, tree)
        for call in (node for node in ast.walk(scope) if isinstance(node, ast.Call)):
            for written, place, comparison, bound in _stated(call, known):
                for gate in [written] if written in GATES else gates:
                    found[gate, place] = Bounded(gate, comparison, bound)
    return found


def _gates_of(scope: ast.stmt, tree: ast.Module) -> list[Gate]:
    """Gates for which a function of bounds is called; none of anything else."""
    if not isinstance(scope, ast.FunctionDef) or scope.name == ALWAYS_ZERO:
        return []
    calls = (node for node in ast.walk(tree) if isinstance(node, ast.Call))
    own = (c for c in calls if isinstance(c.func, ast.Name) and c.func.id == scope.name)
    asked = {arg.value for call in own for arg in call.args if isinstance(arg, ast.Constant)}
    return [gate for gate in GATES if gate in asked]


def _stated(
    call: ast.Call, known: Mapping[str, object]
) -> Iterator[tuple[Gate | None, str, str, float]]:
    """Gate (None where a function is given it), place, comparison and bound of one call."""
    name = call.func.id if isinstance(call.func, ast.Name) else ""
    values = [
        arg.value if isinstance(arg, ast.Constant)
        else known.get(arg.id) if isinstance(arg, ast.Name)
        else None
        for arg in call.args
    ]  # fmt: skip
    gate = next((one for one in GATES if values[:1] == [one]), None)
    if name == ALWAYS_ZERO:
        yield from ((gate, str(place), "<=", 0.0) for place in values[2:])
    if name == "Bound" and len(values) > 3 and isinstance(values[3], int | float):
        yield gate, str(values[1]), str(values[2]), float(values[3])


def bound_moves(before: str, now: str) -> dict[str, tuple[Gate, Kind, str, str]]:
    """What moved between two texts of the module: gate, kind, from what, to what, by place.

    Args:
        before: The earlier text; empty where there was none.
        now: The later one.
    """
    old, new = bounds_in(before), bounds_in(now)
    found: dict[str, tuple[Gate, Kind, str, str]] = {}
    for key in dict.fromkeys([*old, *new]):
        one, other = old.get(key), new.get(key)
        if one != other:
            gate = (other or one or Bounded("A", "", 0.0)).gate
            found[f"{FLOORS}: {key[0]}.{key[1]}"] = (
                gate, _kind(one, other), str(one or NONE), str(other or NONE)
            )  # fmt: skip
    return found


def _kind(old: Bounded | None, new: Bounded | None) -> Kind:
    """Whether a limit may be looser than before."""
    if old is None or new is None:
        return "loosened" if new is None else "tightened"
    if old.comparison != new.comparison:
        return "changed"
    lower = new.bound < old.bound
    return "tightened" if lower == (new.comparison == "<=") else "loosened"
