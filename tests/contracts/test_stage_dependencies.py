"""DVC re-runs a stage for what `deps` lists: what the stage reaches, no more and no less."""

import re
import sys
from collections.abc import Iterable
from pathlib import Path, PurePosixPath

import pytest
import yaml

sys.path.insert(0, str(Path(__file__).parent))

from dependencies import (
    BELOW,
    IDENTITY,
    ROOT,
    TABLE,
    TASK_STAGE,
    asks_for_the_identity,
    code_deps,
    data_files,
    is_code,
    module_file,
    of_a_plugin,
    pipeline,
    plugins,
    reached_files,
    reached_modules,
    rerun_after_edit,
    stage_names,
    table,
)

from gates.floors import BOUNDS
from gates.pipeline import RUNGS, names_in
from gates.preregistration import PREREGISTRATION, asked_by, plan_of
from gates.proof import SPECS
from gates.protection import REHEARSAL
from gates.report import GATES, stage_of
from gates.settings import AND


@pytest.mark.parametrize("stage", stage_names())
def test_deps_are_the_code_that_the_stage_reaches_no_more_and_no_less(stage: str) -> None:
    deps = sorted(dep for dep in pipeline()[stage]["deps"] if is_code(dep))
    assert deps == code_deps(stage), "run `python tests/contracts/dependencies.py --write`"


@pytest.mark.parametrize("stage", stage_names())
def test_deps_name_every_file_that_the_stage_reaches(stage: str) -> None:
    missing = uncovered(reached_files(stage), pipeline()[stage]["deps"])
    assert not missing, f"add to deps of {stage} in dvc.yaml: {missing}"


def test_the_table_of_what_an_edit_re_runs_is_derived_from_the_pipeline() -> None:
    assert TABLE.read_text() == table(), "run `python tests/contracts/dependencies.py --write`"


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
    verdicts = {
        "candidates": "a",
        "train_generators": "a",
        "shadow": "b",
        "wall_clock": "c",
        "stress": "c",
        "monitors": "c",
        "failure_search": "d",
        "card": "d",
    }
    for stage, gate in verdicts.items():
        assert f"artifacts/gate_{gate}/verdict.json" in pipeline()[stage]["deps"]
    for stage in stage_names():
        asks = f'admit("{stage}"' in (ROOT / "stages" / f"{stage}.py").read_text()
        assert asks == (stage in {*verdicts, "reload", "latency"}), stage


EVIDENCE = (
    "record", "ingest", "audit", "train_baselines", "measure_baselines", "train_factors",
    "measure_factors", "train_generators", "reload", "latency", "shadow", "wall_clock",
    "stress", "monitors", "failure_search",
)  # fmt: skip
TRAINING = ("train_baselines", "train_factors", "train_generators")
JUDGING = ("gate_a", "gate_b", "gate_c", "gate_d", "card", "gate_e")


def test_an_edit_of_the_executor_runs_what_executes_again_and_no_other_evidence() -> None:
    direct, behind = rerun_after_edit("genpolicy/execution")
    again = [name for name in (*direct, *behind) if name in EVIDENCE]
    assert again == ["shadow", "wall_clock", "stress", "monitors", "failure_search"]


def test_each_file_that_is_left_out_of_its_folder_has_a_row_and_says_what_it_runs() -> None:
    rows = [line for line in TABLE.read_text().splitlines() if line.startswith("| `")]
    for file in sorted(BELOW):
        (row,) = [line for line in rows if line.startswith(f"| `{file}` |")]
        direct, _ = rerun_after_edit(file)
        assert {"measure_baselines", "shadow", "stress"} <= set(direct), file
        assert f"| {' '.join(direct)} |" in row
        listed = [name for name, stage in pipeline().items() if uncovered([file], stage["deps"])]
        assert not set(listed) & set(direct)


@pytest.mark.parametrize("package", ["feasibility", "execution", "robot", "tasks", "evidence"])
def test_an_edit_of_what_judges_actions_trains_nothing_again(package: str) -> None:
    direct, _ = rerun_after_edit(f"genpolicy/{package}")
    # Gates take the names of columns from the evidence, and admission proves gates.
    assert not set(direct) & set(TRAINING)


def test_an_edit_of_a_network_or_sampler_audits_nothing_again() -> None:
    direct, _ = rerun_after_edit("genpolicy/policies")
    assert "train_baselines" in direct and "audit" not in direct


def test_an_edit_of_a_gate_judges_again_and_measures_nothing() -> None:
    for package in ("gates", "gates/pages"):
        direct, _ = rerun_after_edit(package)
        # The first stage runs every time, whatever is edited, and writes the same bytes.
        assert set(direct) - {"task"} <= set(JUDGING)


NEVER = {
    "train_baselines": {"task", "feasibility", "execution"},
    "train_factors": {"task", "feasibility", "execution"},
    "train_generators": {"task", "feasibility", "execution"},
    "audit": {"execution", "policy"},
    "measure_baselines": {"execution", "policy"},
    "measure_factors": {"execution", "policy"},
    "reload": {"execution", "policy"},
    "latency": {"execution", "policy", "stress"},
    "shadow": {"policy", "train_generators", "stress"},
    "stress": {"policy", "train_generators", "latency", "shadow", "monitors"},
    "monitors": {"policy", "train_generators", "latency", "shadow", "stress"},
    "failure_search": {"policy", "train_generators", "latency", "shadow", "monitors", "card"},
}


@pytest.mark.parametrize("stage", NEVER)
def test_a_stage_lists_only_the_parameters_that_it_reads(stage: str) -> None:
    assert not set(pipeline()[stage]["params"]) & NEVER[stage]


@pytest.mark.parametrize("stage", stage_names())
def test_every_section_that_a_stage_parses_is_among_its_parameters(stage: str) -> None:
    text = (ROOT / "stages" / f"{stage}.py").read_text()
    listed = {name.split(".")[0] for name in pipeline()[stage]["params"]}
    assert set(re.findall(r'params\.section\("(\w+)"', text)) <= listed
    assert ("params.seed" not in text) or "seed" in listed
    assert ("params.horizons" not in text) or "horizons" in listed
    assert ("params.task" not in text) or "task" in listed


def _judged_by(gate: str) -> set[str]:
    """Places of `params.yaml` that a gate reads: its own section, homes, bounds, and the plan."""
    with (ROOT / "params.yaml").open() as stream:
        plan = plan_of(yaml.safe_load(stream))
    reached = GATES[: GATES.index(gate) + 1]
    stated = getattr(SPECS[gate].settings, "homes", {})
    homes = [home for both in stated.values() for home in both.split(AND)]
    bounds = {bound.place for bound in BOUNDS if bound.gate == gate and "." in bound.place}
    planned = {place for place in plan if asked_by(place) in reached}
    return {stage_of(gate), REHEARSAL, *homes, *bounds, *planned}


@pytest.mark.parametrize("gate", GATES)
def test_a_gate_judges_again_where_anything_moves_that_it_reads(gate: str) -> None:
    listed = [tuple(key.split(".")) for key in pipeline()[stage_of(gate)]["params"]]
    missing = [
        place
        for place in sorted(_judged_by(gate))
        if not any(tuple(place.split("."))[: len(key)] == key for key in listed)
    ]
    assert not missing, f"add to params of {stage_of(gate)} in dvc.yaml: {missing}"


@pytest.mark.parametrize("gate", GATES)
def test_a_gate_judges_again_where_a_stage_under_it_may_have_run_again(gate: str) -> None:
    """Its report binds their recorded runs: one from another input to the same bytes refuses it."""
    own = pipeline()[stage_of(gate)]
    read, listed = set(names_in(own["deps"])), set(names_in(own["params"]))
    for stage in RUNGS[gate]:
        below = pipeline()[stage]
        missing = [path for path in names_in(below.get("deps")) if not _within(path, read, "/")]
        missing += [key for key in names_in(below.get("params")) if not _within(key, listed, ".")]
        assert not missing, f"add to {stage_of(gate)} in dvc.yaml, as of {stage}: {missing}"


def _within(name: str, listed: set[str], sign: str) -> bool:
    return name in listed or any(name.startswith(other + sign) for other in listed)


@pytest.mark.parametrize("gate", GATES)
def test_a_gate_that_says_what_moved_since_the_plan_depends_on_it(gate: str) -> None:
    assert PREREGISTRATION in pipeline()[stage_of(gate)]["deps"]


def test_the_pipeline_has_stages_at_all() -> None:
    assert len(stage_names()) >= 15
    assert set(stage_names()) == set(pipeline())


def uncovered(files: Iterable[str], deps: Iterable[str]) -> list[str]:
    """Files that no dependency names, itself or by a folder above it."""
    named = {PurePosixPath(dep) for dep in deps}
    return sorted(
        file for file in files if not named & {PurePosixPath(file), *PurePosixPath(file).parents}
    )


def test_a_dependency_left_out_is_found() -> None:
    files = {"genpolicy/a/x.py", "genpolicy/b.py", "genpolicy/ab/y.py"}
    assert uncovered(files, ["genpolicy/a", "genpolicy/b.py"]) == ["genpolicy/ab/y.py"]
    assert uncovered(files, ["genpolicy"]) == []
    assert uncovered(files, []) == sorted(files)


def test_the_walk_sees_indirect_imports_packages_and_data() -> None:
    modules = reached_modules("genpolicy.pages.audit.page")
    assert {"genpolicy", "genpolicy.errors", "genpolicy.pages"} <= modules
    files = {module_file(module) for module in modules} | data_files(modules)
    assert "genpolicy/pages/style.css" in files
    assert all((ROOT / file).is_file() for file in files)


@pytest.mark.parametrize("stage", stage_names())
def test_a_stage_that_loads_a_task_depends_on_its_identity_not_on_its_files(stage: str) -> None:
    deps = pipeline()[stage]["deps"]
    assert (IDENTITY in deps) == (asks_for_the_identity(stage) and stage != TASK_STAGE)
    plugin_files = {module_file(plugin) for plugin in plugins()}
    assert uncovered(plugin_files, deps) == sorted(plugin_files)


def test_what_a_plugin_imports_from_the_library_stays_a_dependency() -> None:
    reached = reached_modules("stages.record")
    assert "genpolicy.robot.impedance" in reached
    assert not any(of_a_plugin(module) for module in reached)


def test_the_identity_is_written_every_time() -> None:
    assert pipeline()[TASK_STAGE]["always_changed"] is True


def _outputs() -> list[PurePosixPath]:
    found = []
    for stage in pipeline().values():
        for kind in ("outs", "metrics", "plots"):
            for entry in stage.get(kind) or ():
                found += [PurePosixPath(x) for x in ([entry] if isinstance(entry, str) else entry)]
    return found
