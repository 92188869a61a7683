"""What each stage imports, and so what DVC must list: derived from the code, never by hand.

`python tests/contracts/dependencies.py --write` puts the code dependencies of every stage into
`dvc.yaml` and the table of what an edit re-runs into `docs/dependencies.md`; the contract tests
hold both against the code.
"""

import re
import sys
import tomllib
from collections.abc import Iterable
from functools import cache
from pathlib import Path, PurePosixPath

import grimp
import yaml

ROOT = Path(__file__).parents[2]
PACKAGES = ("genpolicy", "gates", "stages", "flows")
CODE = ("genpolicy", "gates", "stages")
TABLE = ROOT / "docs" / "dependencies.md"
TASK_LOADER = "genpolicy.tasks.api"
CONTRACTS = "stages._contracts"
TASK_STAGE, IDENTITY = "task", "artifacts/task/identity.json"
# Admission decides whether a stage may begin, never what it computes. Evidence stages depend on
# what it decides about (`artifacts/gate_x/verdict.json`), so that an edit of a gate or of a report
# template re-judges, and re-trains only if the verdict changed.
ADMISSION = "gates.proof"
# The ladder's first page is no output of any stage: every gate prints it again, and a whole run
# once more. What draws on it alone is no reason to judge anything again.
FIRST_PAGE = ("gates.pages.page", "gates.pages.clips")
# What hosts a candidate runs in a child, by a command: no import shows that its code decides what
# is answered.
HOSTED = ("genpolicy.candidates.hosts.translation", "genpolicy.cli.serving")
# The table of checks is read by feasibility too (decision 30), so it stands below it: each of these
# files has a row of its own, and the row of the folder is that of the others.
BELOW = {
    "genpolicy/execution/__init__.py",
    "genpolicy/execution/checks.py",
    "genpolicy/execution/moment.py",
    "genpolicy/execution/nanoseconds.py",
    "genpolicy/execution/scene.py",
}
NOT_CODE_DATA = {".py", ".pyc", ".pyi"}


@cache
def graph() -> grimp.ImportGraph:
    """Imports between our modules; one for the type checker only changes nothing a stage does."""
    built = grimp.build_graph(*PACKAGES, cache_dir=None, exclude_type_checking_imports=True)
    for stage in built.find_modules_that_directly_import(ADMISSION):
        if stage.startswith("stages."):
            built.remove_import(importer=stage, imported=ADMISSION)
    built.remove_import(importer=FIRST_PAGE[0], imported=FIRST_PAGE[1])
    built.add_import(importer=HOSTED[0], imported=HOSTED[1])
    return built


@cache
def pipeline() -> dict:
    return (yaml.safe_load((ROOT / "dvc.yaml").read_text()) or {}).get("stages") or {}


def stage_names() -> list[str]:
    """Every stage that either the pipeline or the folder of stages knows."""
    files = {p.stem for p in (ROOT / "stages").glob("*.py") if not p.stem.startswith("_")}
    return sorted(files | set(pipeline()))


@cache
def plugins() -> set[str]:
    """Modules of the tasks that this distribution registers."""
    with (ROOT / "pyproject.toml").open("rb") as stream:
        points = tomllib.load(stream)["project"]["entry-points"]["genpolicy.tasks"]
    return {value.split(":")[0] for value in points.values()}


def of_a_plugin(module: str) -> bool:
    """Whether a module lies in the package of a task."""
    packages = {plugin.rpartition(".")[0] for plugin in plugins()}
    return any(module == package or module.startswith(f"{package}.") for package in packages)


def loads_a_task(stage: str) -> bool:
    """Whether a stage reaches what loads a task, or holds what it reads against its identity."""
    module = f"stages.{stage}"
    reached = {module} | graph().find_upstream_modules(module)
    return bool(reached & {TASK_LOADER, CONTRACTS})


def reached_modules(module: str) -> set[str]:
    """`module`, what it imports directly or not, the packages around them, and the plug-ins.

    The modules of a plug-in itself are left out: a task may be installed outside the tree, so the
    stages depend on its identity, which holds the hash of every file of it, in their place.
    """
    found = {module} | graph().find_upstream_modules(module)
    if TASK_LOADER in found:
        for plugin in plugins():
            found |= graph().find_upstream_modules(plugin)
    found = {name for name in found if not of_a_plugin(name)}
    parents = {
        name.rsplit(".", depth)[0] for name in found for depth in range(1, name.count(".") + 1)
    }
    return found | parents


def module_file(module: str) -> str:
    path = PurePosixPath(*module.split("."))
    package = path / "__init__.py"
    return str(package if (ROOT / package).is_file() else path.with_suffix(".py"))


def data_files(modules: Iterable[str]) -> set[str]:
    """Files that are not Python in the folders of the modules (scenes, templates, schemas)."""
    found = set()
    for folder in {(ROOT / module_file(module)).parent for module in modules}:
        for path in folder.rglob("*"):
            inner = path.parent.relative_to(folder).parts
            package_below = any(
                (folder / Path(*inner[: n + 1]) / "__init__.py").is_file()
                for n in range(len(inner))
            )
            if counts(path) and path.suffix not in NOT_CODE_DATA and not package_below:
                found.add(path.relative_to(ROOT).as_posix())
    return found


def counts(path: Path) -> bool:
    """Whether a path is a file that DVC would hash as part of its folder."""
    return path.is_file() and "__pycache__" not in path.parts and ".tmp." not in path.name


def asks_for_the_identity(stage: str) -> bool:
    """Whether a stage loads a task, or is a gate above one that does and lists none of `task`."""
    of_a_task = TASK_STAGE in rung(stage)
    return loads_a_task(stage) or (not of_a_task and any(map(loads_a_task, rung(stage))))


def rung(stage: str) -> list[str]:
    """Stages between a gate and the one below it, as `dvc.yaml` lists them; none of another stage.

    A report names the code and parameters of the evidence that it judges, so the gate judges again
    when these change.
    """
    names = list(pipeline())
    if not stage.startswith("gate_") or stage not in names:
        return []
    before = names[: names.index(stage)]
    gates = [index for index, name in enumerate(before) if name.startswith("gate_")]
    return before[gates[-1] + 1 if gates else 0 :]


def reached_files(stage: str) -> set[str]:
    if below := rung(stage):
        return _reached(stage).union(*map(_reached, below))
    return _reached(stage)


def bound_outputs(stage: str) -> list[str]:
    """What the evidence stages below a gate write: it binds all of it."""
    outs = [out for name in rung(stage) for out in pipeline()[name]["outs"]]
    return [name for out in outs for name in ([out] if isinstance(out, str) else out)]


def bound_parameters(stage: str) -> list[str]:
    """What the evidence stages below a gate read of `params.yaml`."""
    return sorted({key for name in rung(stage) for key in pipeline()[name]["params"]})


def _reached(stage: str) -> set[str]:
    modules = reached_modules(f"stages.{stage}")
    return {module_file(module) for module in modules} | data_files(modules)


def collapsed(files: set[str]) -> list[str]:
    """The same files, a folder in place of all its files where every one of them is named."""
    result: list[str] = []

    def walk(folder: Path) -> bool:
        """Whether all of `folder` is named; adds what is named of it otherwise."""
        inside = sorted(p for p in folder.iterdir() if p.name != "__pycache__")
        mark = len(result)
        whole = True
        for path in inside:
            if path.is_dir():
                if any(counts(p) for p in path.rglob("*")):
                    whole &= walk(path)
            elif counts(path):
                name = path.relative_to(ROOT).as_posix()
                if name in files:
                    result.append(name)
                else:
                    whole = False
        if whole:
            del result[mark:]
            result.append(folder.relative_to(ROOT).as_posix())
        return whole

    for top in CODE:
        walk(ROOT / top)
    return sorted(result)


def code_deps(stage: str) -> list[str]:
    """What `deps` of a stage must name of our code: what it reaches, no more and no less."""
    return collapsed(reached_files(stage))


def is_code(dep: str) -> bool:
    return PurePosixPath(dep).parts[0] in CODE


def covers(dep: str, file: str) -> bool:
    return PurePosixPath(dep) in {PurePosixPath(file), *PurePosixPath(file).parents}


@cache
def consumers() -> dict[str, set[str]]:
    """Stages that read something which a stage writes, by stage."""
    outputs = {
        name: [
            out
            for kind in ("outs", "metrics", "plots")
            for entry in stage.get(kind) or ()
            for out in ([entry] if isinstance(entry, str) else entry)
        ]
        for name, stage in pipeline().items()
    }
    return {
        name: {
            other
            for other, stage in pipeline().items()
            if any(covers(dep, out) or covers(out, dep) for dep in stage["deps"] for out in outs)
        }
        for name, outs in outputs.items()
    }


def rerun_after_edit(package: str) -> tuple[list[str], list[str]]:
    """Stages that re-run after an edit of a package, and those behind them.

    Args:
        package: Folder below the root, such as `genpolicy/execution`.

    Returns:
        Stages of which a dependency changed, and stages that follow if their inputs then change,
        both in the order of the pipeline. A stage behind a gate's verdict follows only if the
        verdict or its evidence changed.
    """
    inside = PurePosixPath(package)
    direct = {
        name
        for name, stage in pipeline().items()
        if any(
            is_code(dep)
            and (covers(package, dep) or inside.is_relative_to(dep))
            and (dep not in BELOW or dep == package)
            for dep in stage["deps"]
        )
    }
    if of_a_plugin(package.replace("/", ".")):
        direct.add(TASK_STAGE)  # it runs every time, and sees the edit
    behind, open_ones = set(direct), list(direct)
    while open_ones:
        for name in consumers()[open_ones.pop()] - behind:
            behind.add(name)
            open_ones.append(name)
    order = list(pipeline())
    return sorted(direct, key=order.index), sorted(behind - direct, key=order.index)


def packages() -> list[str]:
    """Every folder of code whose edit the table speaks of."""
    own = [
        path.parent.relative_to(ROOT).as_posix()
        for path in sorted((ROOT / "genpolicy").glob("*/__init__.py"))
    ]
    rooms = [
        path.parent.relative_to(ROOT).as_posix()
        for parent in ("data", "evidence", "tasks")
        for path in sorted((ROOT / "genpolicy" / parent).glob("*/__init__.py"))
    ]
    return sorted({*own, *rooms, "gates", "gates/pages", *BELOW})


def table() -> str:
    """The page of what an edit re-runs."""
    lines = [
        "# What re-runs after an edit",
        "",
        "Derived from `dvc.yaml` by `python tests/contracts/dependencies.py --write`; a",
        "test holds it there. *Runs again*: a dependency of the stage lies in the package. *May",
        "follow*: reads what one of those writes, and runs only if that came out different; behind",
        "a gate, only if the verdict or the evidence under it did.",
        "",
        "Two things are left out or added on purpose. A stage that asks a gate for admission does",
        f"not depend on the code of `{ADMISSION}`, only on the verdict, so an edit of a gate",
        "measures nothing again; and a gate depends on all code and parameters of the evidence",
        "stages under it, since its report names them, so it judges again when they change.",
        "Files of `genpolicy/execution/` that feasibility reads as well have rows of their own,",
        "and are not meant by the row of that folder.",
        "",
        "| edit in | runs again | may follow |",
        "|---|---|---|",
    ]
    for package in packages():
        direct, behind = rerun_after_edit(package)
        cells = [" ".join(names) or "nothing" for names in (direct, behind)]
        shown = package if package.endswith(".py") else f"{package}/"
        lines.append(f"| `{shown}` | {cells[0]} | {cells[1]} |")
    return "\n".join([*lines, ""])


def rewritten(text: str) -> str:
    """`dvc.yaml` with the code dependencies of every stage put right, comments kept."""
    lines, result = text.split("\n"), []
    stage, at_deps, at_params, listed = "", False, False, set[str]()
    for line in lines:
        named = re.fullmatch(r"  (\w+):", line)
        if named:
            stage = named[1]
        if at_deps and not line.startswith("      - "):
            at_deps = False
            result += [f"      - {out}" for out in bound_outputs(stage) if out not in listed]
            result += [f"      - {dep}" for dep in code_deps(stage)]
        if at_params and not line.startswith("      - "):
            at_params = False
            result += [f"      - {key}" for key in bound_parameters(stage) if key not in listed]
        dep = line.removeprefix("      - ").strip()
        if at_deps and (is_code(dep) or dep == IDENTITY):
            continue
        result.append(line)
        listed.add(dep)
        if line == "    params:":
            at_params, listed = True, set()
        if line == "    deps:":
            at_deps, listed = True, set()
            if stage != TASK_STAGE and asks_for_the_identity(stage):
                result.append(f"      - {IDENTITY}")
    return "\n".join(result)


def main(arguments: list[str]) -> int:
    """Write both, or say what would change."""
    path = ROOT / "dvc.yaml"
    new = rewritten(path.read_text())
    if arguments == ["--write"]:
        path.write_text(new)
        pipeline.cache_clear()
        consumers.cache_clear()
        TABLE.write_text(table())
        return 0
    stale = new != path.read_text() or table() != TABLE.read_text()
    print("stale; run with --write" if stale else "up to date")
    return int(stale)


if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))
    sys.exit(main(sys.argv[1:]))
