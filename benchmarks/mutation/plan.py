"""Which wrong modules are made, and which tests must notice them."""

import difflib
import random
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
SWAPPED = (
    "Add_Sub", "Sub_Add", "Mul_Div", "Div_Mul", "FloorDiv_Div", "Mod_Mul", "Pow_Mul",
    "BitAnd_BitOr", "BitXor_BitAnd", "LShift_RShift", "RShift_LShift",
)  # fmt: skip
COMPARED = (
    "Lt_LtE", "Lt_GtE", "LtE_Lt", "LtE_Gt", "Gt_GtE", "Gt_LtE", "GtE_Gt", "GtE_Lt",
    "Eq_NotEq", "NotEq_Eq", "Is_IsNot", "IsNot_Is",
)  # fmt: skip
KINDS = (
    *(f"core/ReplaceBinaryOperator_{name}" for name in SWAPPED),
    *(f"core/ReplaceComparisonOperator_{name}" for name in COMPARED),
    "core/ReplaceUnaryOperator_Delete_Not",
    "core/ReplaceUnaryOperator_USub_UAdd",
    "core/AddNot",
    "core/ReplaceTrueWithFalse",
    "core/ReplaceFalseWithTrue",
    "core/ReplaceAndWithOr",
    "core/ReplaceOrWithAnd",
    "core/ReplaceBreakWithContinue",
    "core/ReplaceContinueWithBreak",
    "core/ExceptionReplacer",
    "core/NumberReplacer",
    "core/ZeroIterationForLoop",
)
EVERY = ("tests/gates/test_forms.py",)
"""Tests that ask every class and function of the gates; the last that a mutant meets."""
JUDGED = ("tests/gates/test_criteria.py",)
GOLDEN = "tests/gates/golden/test_gate_"
FORMS = "tests/execution/test_forms.py"
PAGES = ("tests/gates/test_writing.py", "tests/gates/pages", "tests/gates/test_overview.py")
ON_PAGE = {
    "a": ("plots_factors", "plots_need", "plots_scene"),
    "b": ("plots_convergence", "plots_density", "plots_front", "plots_time"),
    "c": ("plots_feasibility", "plots_incidents", "plots_rejected", "tables_feasibility",
          "tables_holds"),
    "d": ("plots_stress", "tables_overruns", "tables_recovery", "tables_stress"),
}  # fmt: skip
"""Modules that one gate's page alone shows."""
TESTS = {
    **{
        f"gates/pages/{name}.py": (f"{GOLDEN}{gate}.py", *PAGES)
        for gate, names in ON_PAGE.items()
        for name in names
    },
    "gates/card/keys.py": (),
    "gates/card/history.py": (),
    "gates/card/envelope.py": ("tests/gates/card/test_card.py", "tests/gates/card"),
    "gates/card": (f"{GOLDEN}e.py", "tests/gates/card"),
    "gates/cause": ("tests/gates/cause", f"{GOLDEN}a.py", "tests/gates/need"),
    "gates/audit": ("tests/gates/audit",),
    "gates/diagnosis": ("tests/gates/diagnosis/test_golden_answers.py", "tests/gates/diagnosis"),
    "gates/ledger": ("tests/gates/ledger",),
    "gates/package": ("tests/gates/package",),
    "gates/need": (f"{GOLDEN}a.py", "tests/gates/need", *JUDGED),
    "gates/pages": (f"{GOLDEN}c.py", *PAGES),
    "gates/stress": (f"{GOLDEN}d.py", "tests/gates/stress", *JUDGED),
    "gates/feasibility": (f"{GOLDEN}c.py", "tests/gates/feasibility", *JUDGED),
    "gates/reproducibility": (f"{GOLDEN}b.py", "tests/gates/reproducibility", *JUDGED),
    "gates/bounds.py": ("tests/gates/stress",),
    "gates/commands.py": (
        "tests/gates/test_commands_of_a_ladder.py",
        "tests/gates/card/test_card_commands.py",
    ),
    "gates/criterion.py": ("tests/gates/test_engine.py",),
    "gates/evidence.py": JUDGED,
    "gates/engine.py": ("tests/gates/test_pipeline.py", *JUDGED),
    "gates/differences.py": ("tests/gates/test_proof.py",),
    "gates/proof.py": ("tests/gates/test_pipeline.py",),
    "gates/rederive_disturbance.py": ("tests/gates/test_rederive.py",),
    "gates/rederive_latency.py": ("tests/gates/test_rederive.py",),
    "gates/report.py": ("tests/gates/test_proof.py",),
    "gates/run_commands.py": ("tests/gates/test_ci_files.py", "tests/gates/test_status.py"),
    "genpolicy/execution": (
        "tests/execution/test_golden_journal.py",
        FORMS,
        "tests/execution",
        "tests/verification/test_state_machine.py",
    ),
    "genpolicy/feasibility": (
        "tests/feasibility/test_golden_reasons.py",
        FORMS,
        "tests/feasibility",
    ),
}
"""Tests that a mutant meets after those of the file that mirrors its own; elsewhere none."""
OTHERS = {"gates/stress": "ABC", "gates/feasibility": "AB", "gates/reproducibility": "ACD"}
"""Gates that import nothing of a folder: their cases in `JUDGED` cannot notice, and are left out.

What a wrong constant does when a module is imported is seen by any of the cases that stay.
"""

SLOW = "test_dense"
"""Looks at every millisecond for minutes: a mutant would be called killed because it takes long."""


@dataclass(frozen=True)
class Mutant:
    """One change of one module.

    Attributes:
        path: The module.
        kind: Operator of Cosmic Ray.
        occurrence: Which of its places.
        line: Line of the place.
        inside: Function or class around it.
    """

    path: str
    kind: str
    occurrence: int
    line: int
    inside: str


def mutants_of(path: str) -> list[Mutant]:
    """Every mutant of a module that a test has to kill."""
    from cosmic_ray.ast import ast_nodes, get_ast
    from cosmic_ray.ast.ast_query import ASTQuery
    from cosmic_ray.plugins import get_operator

    tree = get_ast((ROOT / path).read_text())
    found = []
    for kind in KINDS:
        operator = get_operator(kind)()
        places = (
            (node, start)
            for node in ast_nodes(tree)
            for start, _ in operator.mutation_positions(node)
        )
        for occurrence, (node, start) in enumerate(places):
            inside = ASTQuery(node).get_definition_name() or ""
            found.append(Mutant(path, kind, occurrence, start[0], inside))
    return found


def text_of(path: str, kind: str, occurrence: int) -> str:
    """The module's text with the mutant in it."""
    from cosmic_ray.mutating import mutate_code
    from cosmic_ray.plugins import get_operator

    changed = mutate_code((ROOT / path).read_text(), get_operator(kind)(), occurrence)
    assert changed is not None, (path, kind, occurrence)
    return str(changed)


def change_of(mutant: Mutant) -> str:
    """Lines that a mutant takes away and puts in."""
    before = (ROOT / mutant.path).read_text()
    after = text_of(mutant.path, mutant.kind, mutant.occurrence)
    lines = difflib.unified_diff(before.splitlines(), after.splitlines(), n=0, lineterm="")
    return "\n".join(" ".join(line.split()) for line in list(lines)[2:] if line[0] in "+-")


def tests_of(path: str) -> list[str]:
    """Tests that a mutant of a module is held against: its mirror first, then its folder's.

    File by file: pytest drops a file that is named beside its folder, and the mirror would be met
    where the alphabet has it.
    """
    place = Path(path.removeprefix("genpolicy/"))
    mirror = f"tests/{place.parent}/test_{place.name}"
    found = next((tests for key, tests in TESTS.items() if path.startswith(key)), ())
    named = (mirror, *found, *(EVERY if path.startswith("gates/") else ()))
    return list(dict.fromkeys(file for name in named for file in _files(name)))


def _files(name: str) -> list[str]:
    """A file of tests, if it is there; of a folder those in it."""
    place = ROOT / name
    found = sorted(place.rglob("test_*.py")) if place.is_dir() else [place]
    return [file.relative_to(ROOT).as_posix() for file in found if file.is_file()]


def cases_of(path: str) -> str:
    """What to ask pytest for: no case of a gate that does not import a module, none of minutes."""
    if path.startswith("genpolicy/feasibility"):
        return f"not {SLOW}"
    others = next((gates for key, gates in OTHERS.items() if path.startswith(key)), "")
    return " and ".join(f"not [{gate}- and not [{gate}]" for gate in others)


def modules(places: Sequence[str]) -> Iterator[str]:
    """Modules at or below some places."""
    for place in places:
        found = sorted((ROOT / place).rglob("*.py")) if (ROOT / place).is_dir() else [ROOT / place]
        yield from (file.relative_to(ROOT).as_posix() for file in found)


def inside(path: str, places: Sequence[str]) -> bool:
    """Whether a module lies at or below one of some places."""
    return any(path == place or path.startswith(f"{place}/") for place in places)


def drawn(places: Sequence[str], sample: int, seed: int) -> list[Mutant]:
    """A fixed random sample of the mutants at some places, without replacement; 0 takes all.

    In random order, so that a run that is cut leaves a random sample too.
    """
    found = [mutant for path in modules(places) for mutant in mutants_of(path)]
    print(f"{len(found)} mutants in {', '.join(places)}", flush=True)
    order = random.Random(f"{seed} {' '.join(places)}").sample(found, len(found))
    return order[:sample] if sample else order
