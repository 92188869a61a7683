"""DVC re-runs a stage only for what `deps` lists: every file that a stage reaches must be there."""

import tomllib
from collections.abc import Iterable
from functools import cache
from pathlib import Path, PurePosixPath

import grimp
import pytest
import yaml

ROOT = Path(__file__).parents[2]
PACKAGES = ("genpolicy", "gates", "stages", "flows")
TASK_LOADER = "genpolicy.tasks.api"
# Admission decides whether a stage may begin, never what it computes. Evidence stages depend on
# what it decides about (`artifacts/gate_x/verdict.json`), so that an edit of a gate or of a report
# template re-judges, and re-trains only if the verdict changed.
ADMISSION = "gates.admission"
NOT_CODE_DATA = {".py", ".pyc", ".pyi"}


@cache
def graph() -> grimp.ImportGraph:
    # An import for the type checker only cannot change what a stage does.
    built = grimp.build_graph(*PACKAGES, cache_dir=None, exclude_type_checking_imports=True)
    built.remove_module(ADMISSION)
    return built


@cache
def pipeline() -> dict:
    return (yaml.safe_load((ROOT / "dvc.yaml").read_text()) or {}).get("stages") or {}


def stage_names() -> list[str]:
    """Every stage that either the pipeline or the folder of stages knows."""
    files = {p.stem for p in (ROOT / "stages").glob("*.py") if not p.stem.startswith("_")}
    return sorted(files | set(pipeline()))


def reached_modules(module: str) -> set[str]:
    """`module`, what it imports directly or not, the packages around them, and the plug-ins."""
    found = {module} | graph().find_upstream_modules(module)
    if TASK_LOADER in found:
        with (ROOT / "pyproject.toml").open("rb") as stream:
            points = tomllib.load(stream)["project"]["entry-points"]["genpolicy.tasks"]
        for value in points.values():
            plugin = value.split(":")[0]
            found |= {plugin} | graph().find_upstream_modules(plugin)
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
            hidden = "__pycache__" in path.parts or ".tmp." in path.name
            if (
                path.is_file()
                and path.suffix not in NOT_CODE_DATA
                and not (package_below or hidden)
            ):
                found.add(path.relative_to(ROOT).as_posix())
    return found


def uncovered(files: Iterable[str], deps: Iterable[str]) -> list[str]:
    """Files that no dependency names, itself or by a folder above it."""
    named = {PurePosixPath(dep) for dep in deps}
    return sorted(
        file for file in files if not named & {PurePosixPath(file), *PurePosixPath(file).parents}
    )


def reached_files(stage: str) -> set[str]:
    modules = reached_modules(f"stages.{stage}")
    return {module_file(module) for module in modules} | data_files(modules)


@pytest.mark.parametrize("stage", stage_names())
def test_deps_name_every_file_that_the_stage_reaches(stage: str) -> None:
    deps = pipeline()[stage]["deps"]
    missing = uncovered(reached_files(stage), deps)
    assert not missing, f"add to deps of {stage} in dvc.yaml: {missing}"


@pytest.mark.parametrize("stage", stage_names())
def test_deps_name_nothing_that_is_not_there(stage: str) -> None:
    outputs = set(_outputs())
    for dep in pipeline()[stage]["deps"]:
        path = PurePosixPath(dep)
        made = outputs & {path, *path.parents}
        makes_below = any(path in out.parents for out in outputs)
        assert made or makes_below or (ROOT / path).exists(), f"{stage} depends on {dep}"


@pytest.mark.parametrize("stage", stage_names())
def test_no_stage_imports_another(stage: str) -> None:
    for other in stage_names():
        if other != stage:
            assert f"stages.{other}" not in reached_modules(f"stages.{stage}"), (
                f"stage {stage} imports stage {other}; stages meet in artifacts/"
            )


def test_a_stage_that_asks_for_admission_depends_on_the_verdict_before_it() -> None:
    verdicts = {"generators": "a", "shadow": "b", "stress": "c", "card": "d"}
    for stage, gate in verdicts.items():
        assert f"artifacts/gate_{gate}/verdict.json" in pipeline()[stage]["deps"]
    for stage in stage_names():
        asks = f'admit("{stage}"' in (ROOT / "stages" / f"{stage}.py").read_text()
        assert asks == (stage in {*verdicts, "reload", "latency"}), stage


def test_the_pipeline_has_stages_at_all() -> None:
    assert len(stage_names()) >= 15
    assert set(stage_names()) == set(pipeline())


def test_a_dependency_left_out_is_found() -> None:
    files = {"genpolicy/a/x.py", "genpolicy/b.py", "genpolicy/ab/y.py"}
    assert uncovered(files, ["genpolicy/a", "genpolicy/b.py"]) == ["genpolicy/ab/y.py"]
    assert uncovered(files, ["genpolicy"]) == []
    assert uncovered(files, []) == sorted(files)


def test_the_walk_sees_indirect_imports_packages_and_data() -> None:
    modules = reached_modules("genpolicy.tasks.api")
    assert {"genpolicy", "genpolicy.errors", "genpolicy.tasks"} <= modules
    files = {module_file(module) for module in modules} | data_files(modules)
    assert "genpolicy/tasks/tabletop_insertion/scene.xml" in files
    assert all((ROOT / file).is_file() for file in files)


def _outputs() -> list[PurePosixPath]:
    found = []
    for stage in pipeline().values():
        for kind in ("outs", "metrics", "plots"):
            for entry in stage.get(kind) or ():
                found += [PurePosixPath(x) for x in ([entry] if isinstance(entry, str) else entry)]
    return found
