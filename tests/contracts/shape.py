"""The shape of the code in numbers: `python tests/contracts/shape.py` prints the table.

Sizes of files and functions, parameters, lines by package, and how many source files have tests
of their own beside them: `genpolicy/x/y.py` is mirrored by `tests/x/test_y.py`, by
`tests/x/test_y_*.py` or by tests in `tests/x/y/`. Modules without a function (constants, rows and
words as fields) and the stages, which the ladder runs, need none and are not counted.
"""

import ast
import statistics
import sys
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGES = ("genpolicy", "gates", "stages", "flows")
# Lines of every Python file at commit 22d1792, before the house was rebuilt.
BEFORE_COMMIT = "22d1792"
BEFORE = {"genpolicy": 33162, "gates": 5860, "stages": 915, "flows": 776}

LONGEST_FILE = 350
LONGEST_FUNCTION = 60
MOST_PARAMETERS = 6
LEAST_MIRRORED = 0.8


@dataclass(frozen=True)
class Function:
    """One function or method.

    Attributes:
        place: `file:line name`.
        lines: From the decorator to the end.
        parameters: Without `self` and `cls`.
    """

    place: str
    lines: int
    parameters: int


@dataclass(frozen=True)
class Shape:
    """What was counted.

    Attributes:
        files: Lines by file, relative to the root.
        functions: Every function and method.
        mirrored: Source files with tests of their own.
        bare: Source files without.
        declaring: Source files that only declare, so that there is nothing to test.
    """

    files: dict[str, int]
    functions: list[Function]
    mirrored: list[str] = field(default_factory=list)
    bare: list[str] = field(default_factory=list)
    declaring: list[str] = field(default_factory=list)

    @property
    def mirrored_share(self) -> float:
        """Share of source files with tests of their own, 0 to 1."""
        return len(self.mirrored) / max(len(self.mirrored) + len(self.bare), 1)

    def longest_files(self) -> list[str]:
        """Files beyond the aim, the longest first."""
        long = [name for name, lines in self.files.items() if lines > LONGEST_FILE]
        return sorted(long, key=lambda name: -self.files[name])

    def long_functions(self) -> list[Function]:
        """Functions beyond the aim, the longest first."""
        long = [f for f in self.functions if f.lines > LONGEST_FUNCTION]
        return sorted(long, key=lambda f: -f.lines)

    def wide_functions(self) -> list[Function]:
        """Functions with more parameters than the aim, the widest first."""
        wide = [f for f in self.functions if f.parameters > MOST_PARAMETERS]
        return sorted(wide, key=lambda f: -f.parameters)


@cache
def shape() -> Shape:
    """Count the tree."""
    files, functions, mirrored, bare, declaring = {}, [], [], [], []
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            name = path.relative_to(ROOT).as_posix()
            text = path.read_text()
            files[name] = len(text.splitlines())
            tree = ast.parse(text)
            functions += functions_of(tree, name)
            if package == "stages":
                continue  # the ladder runs them
            if not has_code(tree):
                declaring.append(name)
            else:
                (mirrored if is_mirrored(path) else bare).append(name)
    return Shape(files, functions, mirrored, bare, declaring)


def functions_of(tree: ast.Module, name: str) -> list[Function]:
    """Every function of a module, nested ones included."""
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            first = min([node.lineno, *(d.lineno for d in node.decorator_list)])
            taken = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
            own = [argument for argument in taken if argument.arg not in {"self", "cls"}]
            place = f"{name}:{node.lineno} {node.name}"
            found.append(Function(place, (node.end_lineno or first) - first + 1, len(own)))
    return found


def has_code(tree: ast.Module) -> bool:
    """Whether a module does something: constants and fields alone have no behaviour to test."""
    return any(isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) for node in ast.walk(tree))


def is_mirrored(path: Path) -> bool:
    """Whether tests of this source file stand where they are looked for."""
    inner = path.relative_to(ROOT)
    parts = inner.parts[1:] if inner.parts[0] == "genpolicy" else inner.parts
    folder = ROOT.joinpath("tests", *parts[:-1])
    if (folder / f"test_{path.stem}.py").is_file():
        return True
    return any(folder.glob(f"test_{path.stem}_*.py")) or any((folder / path.stem).glob("test_*.py"))


def table() -> str:
    """The numbers, beside what they were and what they should be."""
    now = shape()
    lines = {p: sum(n for f, n in now.files.items() if f.startswith(f"{p}/")) for p in PACKAGES}
    sizes = [size for name, size in now.files.items() if not name.endswith("__init__.py")]
    largest = max(now.files, key=lambda name: now.files[name])
    number = len(now.functions)
    rows = [
        f"largest file       {now.files[largest]:>6}  {largest} (aim <= {LONGEST_FILE})",
        f"files beyond       {len(now.longest_files()):>6}",
        f"median file        {statistics.median(sizes):>6.0f}",
        f"functions          {number:>6}",
        f"  over {LONGEST_FUNCTION} lines    {len(now.long_functions()):>6}  (aim 0)",
        f"  over {MOST_PARAMETERS} parameters{len(now.wide_functions()):>6}"
        f"  {len(now.wide_functions()) / number:.1%}",
        f"mirrored files     {now.mirrored_share:>6.0%}  of {len(now.mirrored) + len(now.bare)}"
        f" (aim >= {LEAST_MIRRORED:.0%}); {len(now.declaring)} more only declare",
        f"{'lines':<18}{'now':>7}  at {BEFORE_COMMIT}",
        *(f"  {p:<16}{lines[p]:>7}{BEFORE[p]:>9}  {lines[p] - BEFORE[p]:+d}" for p in PACKAGES),
        f"  {'all':<16}{sum(lines.values()):>7}{sum(BEFORE.values()):>9}"
        f"  {sum(lines.values()) - sum(BEFORE.values()):+d}",
    ]
    return "\n".join(rows)


def main(arguments: list[str]) -> int:
    """Print the table; with `--all` also what lies beyond an aim."""
    print(table())
    if arguments == ["--all"]:
        now = shape()
        for title, names in (
            ("long files", [f"{now.files[name]:5} {name}" for name in now.longest_files()]),
            ("long functions", [f"{f.lines:5} {f.place}" for f in now.long_functions()]),
            ("many parameters", [f"{f.parameters:5} {f.place}" for f in now.wide_functions()]),
            ("without tests beside them", [f"      {name}" for name in now.bare]),
            (
                "declare only, packages aside",
                [f"      {name}" for name in now.declaring if not name.endswith("__init__.py")],
            ),
        ):
            print("\n".join(["", f"{title}:", *names]))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
