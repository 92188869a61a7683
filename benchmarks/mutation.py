"""Would the tests of the gates notice? Wrong gates, made by a tool, and the share that turns red.

The mutants are those of Cosmic Ray (`pip install -e '.[mutation]'`). They are run here and not by
its own command, because half of the time of a mutant would go into imports: libraries are imported
once, and each mutant is a forked process in which one module of `gates` is compiled from changed
text. No file on disk is changed, so a run that is cut leaves nothing behind. Mutants are skipped
that no test has to kill: those of type annotations, and operators for which Python has no meaning
(`KINDS` says what is kept). See docs/mutation.md.

    python benchmarks/mutation.py run gates/card --sample 60 --near --out build/mutation.jsonl
    python benchmarks/mutation.py again --out build/mutation.jsonl     # its survivors, once more
    python benchmarks/mutation.py show --out build/mutation.jsonl
"""

import argparse
import contextlib
import difflib
import importlib.abc
import importlib.machinery
import importlib.util
import json
import os
import random
import resource
import signal
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path

ROOT = Path(__file__).parents[1]
CPU_S = 150
"""A mutant that needs more processor time than this hangs: killed. The slowest tests need 60."""
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
JUDGED = ("tests/gates/test_criteria.py",)
TESTS = {
    "gates/card/keys.py": (),
    "gates/card/history.py": (),
    "gates/card/envelope.py": ("tests/gates/card/test_card.py", "tests/gates/card"),
    "gates/card": ("tests/gates/card",),
    "gates/cause": ("tests/gates/cause", "tests/gates/need"),
    "gates/audit": ("tests/gates/audit",),
    "gates/need": ("tests/gates/need", *JUDGED),
    "gates/pages": ("tests/gates/pages", "tests/gates/test_overview.py"),
    "gates/stress": ("tests/gates/stress", *JUDGED),
    "gates/feasibility": ("tests/gates/feasibility", *JUDGED),
    "gates/reproducibility": ("tests/gates/test_reproducibility.py", *JUDGED),
    "gates/bounds.py": ("tests/gates/stress",),
    "gates/criterion.py": ("tests/gates/test_engine.py",),
    "gates/evidence.py": JUDGED,
    "gates/engine.py": ("tests/gates/test_pipeline.py", *JUDGED),
    "gates/differences.py": ("tests/gates/test_proof.py",),
    "gates/proof.py": ("tests/gates/test_pipeline.py",),
    "gates/report.py": ("tests/gates/test_proof.py",),
}
"""Tests that a mutant meets after those of the file that mirrors its own; elsewhere none."""


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
    """Tests that a mutant of a module is held against: its mirror first, then its folder's."""
    place = Path(path).relative_to("gates")
    mirror = ROOT / "tests/gates" / place.parent / f"test_{place.name}"
    first = [mirror.relative_to(ROOT).as_posix()] if mirror.is_file() else []
    found = next((tests for key, tests in TESTS.items() if path.startswith(key)), ())
    return first + [name for name in found if name not in first]


class _Changed(importlib.machinery.SourceFileLoader):
    """Compiles a module from other text than lies on disk."""

    text = ""

    def get_code(self, fullname: str):
        return compile(self.text, self.path, "exec", dont_inherit=True)


class _Finder(importlib.abc.MetaPathFinder):
    def __init__(self, path: str, text: str) -> None:
        self.name = path.removesuffix(".py").replace("/", ".").removesuffix(".__init__")
        self.path, self.text = str(ROOT / path), text

    def find_spec(self, fullname, path=None, target=None):
        if fullname != self.name:
            return None
        loader = _Changed(fullname, self.path)
        loader.text = self.text
        return importlib.util.spec_from_file_location(fullname, self.path, loader=loader)


def warm_up() -> None:
    """Import what every mutant needs and none changes: libraries and `genpolicy`."""
    read, write = os.pipe()
    if os.fork() == 0:
        try:
            import gates.audit.command
            import gates.commands
            import gates.overview
            import gates.proof
            import gates.rederive  # noqa: F401

            own = ("gates", "tests")
            names = [name for name in sys.modules if name.partition(".")[0] not in own]
            os.write(write, "\n".join(names).encode())
        finally:
            os._exit(0)
    os.close(write)
    with os.fdopen(read, "rb") as pipe:
        names = pipe.read().decode().split()
    os.wait()
    for name in (*names, "pytest", "pytest_timeout", "hypothesis"):
        with contextlib.suppress(Exception):
            importlib.import_module(name)
    assert not [name for name in sys.modules if name.partition(".")[0] == "gates"]


def outcome(path: str, text: str | None, tests: Sequence[str]) -> tuple[str, float, str]:
    """Run tests with a module of other text: outcome, processor seconds, and what turned red."""
    with tempfile.TemporaryDirectory() as scratch:
        log = Path(scratch) / "log"
        child = os.fork()
        if child == 0:
            _run(path, text, tests, log, Path(scratch))
        _, status, used = os.wait4(child, 0)
        said = log.read_text(errors="replace") if log.is_file() else ""
    code = os.waitstatus_to_exitcode(status)
    red = [line.split(" - ")[0] for line in said.splitlines() if line.startswith(("FAILED", "ERR"))]
    name = "survived" if code == 0 else "killed" if code > 0 else "killed (time)"
    return name, round(used.ru_utime + used.ru_stime, 2), (red or [""])[0]


def _run(path: str, text: str | None, tests: Sequence[str], log: Path, scratch: Path) -> None:
    code = 3
    try:
        os.setsid()
        resource.setrlimit(resource.RLIMIT_CPU, (CPU_S, CPU_S + 5))
        signal.signal(signal.SIGXCPU, signal.SIG_DFL)
        out = os.open(log, os.O_WRONLY | os.O_CREAT)
        os.dup2(out, 1)
        os.dup2(out, 2)
        sys.dont_write_bytecode = True
        if text is not None:
            sys.meta_path.insert(0, _Finder(path, text))
        import pytest

        options = ["-x", "-q", "--no-header", "--tb=no", "-p", "no:cacheprovider", "--timeout=0"]
        code = int(pytest.main([*options, f"--basetemp={scratch}/tests", *tests]))
    except BaseException:
        code = 3
    finally:
        with contextlib.suppress(BaseException):
            sys.stdout.flush()
        os._exit(code)


def run(mutants: Sequence[Mutant], out: Path, jobs: int, *, near: bool) -> None:
    """Run mutants; append a line each.

    Args:
        mutants: In which order.
        out: File of results.
        jobs: How many at a time.
        near: Only the tests nearest to the module, as a first look: they take a second or two.
    """
    warm_up()

    def tests(path: str) -> list[str]:
        return tests_of(path)[:1] if near else tests_of(path)

    clean: dict[str, float] = {}
    for path in sorted({mutant.path for mutant in mutants}):
        for name in set(tests(path)) - set(clean):
            found, clean[name], red = outcome(path, None, [name])
            if found != "survived":
                raise SystemExit(f"{name} is red without any mutant: {red}")
            print(f"{name}: green in {clean[name]} s of processor time", flush=True)

    def one(mutant: Mutant) -> tuple[Mutant, str, float, str]:
        text = text_of(mutant.path, mutant.kind, mutant.occurrence)
        return mutant, *outcome(mutant.path, text, tests(mutant.path))

    out.parent.mkdir(parents=True, exist_ok=True)
    with ThreadPoolExecutor(jobs) as pool, out.open("a") as lines:
        for mutant, name, seconds, red in pool.map(one, mutants):
            row = {
                **asdict(mutant),
                "change": change_of(mutant),
                "outcome": name,
                "cpu_s": seconds,
                "red": red,
            }
            lines.write(json.dumps(row) + "\n")
            lines.flush()
            if name == "survived":
                print(f"survived {mutant.path}:{mutant.line} {row['change']}", flush=True)


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


def rows_of(out: Path) -> list[dict]:
    """Last row of each mutant in a file of results."""
    found = {}
    for line in out.read_text().splitlines():
        row = json.loads(line)
        found[row["path"], row["kind"], row["occurrence"]] = row
    return list(found.values())


def show(out: Path) -> None:
    """Print the table of kills by folder, with exact intervals, and the survivors."""
    from genpolicy.statistics.intervals import clopper_pearson

    groups: dict[str, list[dict]] = {}
    for row in rows_of(out):
        folder = "/".join(row["path"].split("/")[:2])
        groups.setdefault(folder if not folder.endswith(".py") else "gates/*.py", []).append(row)
    whole = [row for rows in groups.values() for row in rows]
    print("| where | mutants | killed | survived | share killed | 95 % interval |\n" + "|---" * 6)
    for name, rows in (*sorted(groups.items()), ("all", whole)):
        killed = sum(row["outcome"] != "survived" for row in rows)
        low, high = clopper_pearson(killed, len(rows))
        share = f"{killed / len(rows):.3f} | {low:.3f} to {high:.3f}"
        print(f"| `{name}` | {len(rows)} | {killed} | {len(rows) - killed} | {share} |")
    print()
    for row in whole:
        if row["outcome"] == "survived":
            change = " -> ".join(line[1:].strip() for line in row["change"].splitlines())
            print(f"- `{row['path']}`, {row['inside']}: `{change}` ({row['kind'][5:]})")


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("what", choices=["run", "again", "count", "show"])
    parser.add_argument("places", nargs="*", default=[])
    parser.add_argument("--sample", type=int, default=0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--near", action="store_true")
    parser.add_argument("--out", type=Path, default=ROOT / "build/mutation.jsonl")
    asked = parser.parse_args()
    os.chdir(ROOT)
    sys.path.insert(0, str(ROOT))
    os.environ.update(OMP_NUM_THREADS="1", PYTHONHASHSEED="0", MPLBACKEND="Agg")
    places = asked.places or ["gates"]
    started = time.monotonic()
    if asked.what == "count":
        for path in modules(places):
            print(len(mutants_of(path)), path)
    elif asked.what == "run":
        run(drawn(places, asked.sample, asked.seed), asked.out, asked.jobs, near=asked.near)
        print(f"{time.monotonic() - started:.0f} s")
    elif asked.what == "again":
        left = [row for row in rows_of(asked.out) if row["outcome"] == "survived"]
        fields = Mutant.__dataclass_fields__
        again = [Mutant(**{name: row[name] for name in fields}) for row in left]
        chosen = [mutant for mutant in again if inside(mutant.path, places)]
        run(chosen, asked.out, asked.jobs, near=asked.near)
    else:
        show(asked.out)


if __name__ == "__main__":
    main()
