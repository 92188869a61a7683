"""The library asks the task: no name of the default task's scene or contract stands outside it.

The names are taken from the task itself, so a new body or phase is covered the day it is added;
string literals are read from the syntax trees, so that neither comments nor docstrings count.
"""

import ast
from functools import cache
from pathlib import Path

import mujoco
import pytest

from genpolicy.tasks.api import load_task

ROOT = Path(__file__).parents[2]
TASK = "tabletop_insertion"
PACKAGES = ("genpolicy", "gates", "stages", "flows")

# Words that mean something of the library's own wherever they stand.
SHARED = {
    "tcp": "convention of the scene file: the site at the tool centre point",
    "target": "convention of the scene file: the site where a held object goes in",
    "tcp_position_m": "the recording layout calls the pose of the robot stream so",
    "tcp_rotation": "the same",
    "gripper_opening_m": "the same",
    "wrench_n": "the recording layout calls the force stream's numbers so",
    "phase": "field of every frame, chunk and recording",
    "fixture": "column of shadow evidence: a corrupted input",
    "hand": "word by which columns of foreign datasets are recognised",
    "grasp": "the same",
}
# The same word with another meaning in one file.
LOCAL = {
    ("genpolicy/execution/cell.py", "retreat"): "a primitive of recovery, not a phase",
    ("gates/pages/plots_stress.py", "post"): "matplotlib: a step behind the point",
    ("gates/pages/plots_feasibility.py", "post"): "matplotlib: a step behind the point",
    ("genpolicy/evidence/shadow/rig.py", "approach"): "a phase of the rig's own",
    ("genpolicy/evidence/shadow/rig.py", "insert"): "a phase of the rig's own",
    ("genpolicy/evidence/shadow/mutants.py", "insert"): "a phase of the rig's own",
}


@cache
def names() -> frozenset[str]:
    """Bodies, sites, geoms, joints, phases, channels and their components of the task."""
    task = load_task(TASK)
    model = mujoco.MjModel.from_xml_path(str(task.scene_path))
    of_scene = {
        get(i).name
        for count, get in (
            (model.nbody, model.body), (model.nsite, model.site), (model.ngeom, model.geom),
            (model.njnt, model.joint), (model.neq, model.equality), (model.nu, model.actuator),
        )
        for i in range(count)
    }  # fmt: skip
    of_contract = {*task.phases, *(channel.name for channel in task.observation.channels)}
    return frozenset(of_scene | of_contract) - {""}


def literals(path: Path) -> set[str]:
    """String literals of a module, without docstrings."""
    tree = ast.parse(path.read_text())
    docs = {
        id(node.body[0].value)
        for node in ast.walk(tree)
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef)
        and node.body
        and isinstance(node.body[0], ast.Expr)
    }
    return {
        node.value
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in docs
    }


@cache
def found() -> frozenset[tuple[str, str]]:
    """Every name of the task that stands outside its package: (file, name)."""
    return frozenset(
        (path.relative_to(ROOT).as_posix(), name)
        for package in PACKAGES
        for path in sorted((ROOT / package).rglob("*.py"))
        if f"tasks/{TASK}/" not in path.as_posix()
        for name in literals(path) & names()
    )


def test_the_names_come_from_the_task_itself() -> None:
    expected = {"post", "peg", "link3", "grasp", "insert", "hole_pose", "finger_left", "torque7"}
    assert expected <= names()


def test_nothing_outside_the_task_names_a_part_of_it() -> None:
    left = sorted(item for item in found() - set(LOCAL) if item[1] not in SHARED)
    assert left == [], "ask the task (genpolicy/tasks/api.py) instead of naming it"


def test_no_exception_outlives_its_need() -> None:
    assert sorted(set(LOCAL) - found()) == []
    assert sorted(set(SHARED) - {name for _, name in found()}) == []


@pytest.mark.parametrize("word", ["insert", "post", "hole_pose"])
def test_words_of_the_task_alone_are_not_shared(word: str) -> None:
    assert word in names() and word not in SHARED


def test_a_literal_is_found_and_a_docstring_is_not(tmp_path: Path) -> None:
    module = tmp_path / "m.py"
    module.write_text(
        '"""post"""\n# hole\ndef f(x="peg"):\n    "insert"\n    return {"align": 1}\n'
    )
    assert literals(module) & names() == {"peg", "align"}
