"""The library asks the task: no name of the default task's scene or contract stands outside it.

The names are taken from the task itself, so a new body or phase is covered the day it is added;
string literals are read from the syntax trees, so that neither comments nor docstrings count. What
is packaged beside the code (limits, templates) is read too, and every text also word by word, so
that a sentence or a compound name cannot hide a part of the task.
"""

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import mujoco
import pytest
import yaml

from genpolicy.tasks.api import load_task

ROOT = Path(__file__).parents[2]
TASKS = ("tabletop_insertion", "tight_insertion")
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
# Arguments of numpy and matplotlib whose values are words of theirs.
PLACING = {"side", "ha", "loc", "alignment"}
# The same word with another meaning in one file.
LOCAL = {
    ("genpolicy/audit/learned.py", "left"): "numpy: the side of equals in `searchsorted`",
    ("genpolicy/audit/learned.py", "right"): "the same",
    ("genpolicy/pages/audit/pictures.py", "left"): "matplotlib: where a title stands",
    ("genpolicy/pages/figures/drawing.py", "left"): "the same",
    ("genpolicy/replay/panels.py", "left"): "Foxglove: on which side of a plot its legend stands",
    ("genpolicy/data/formats/consequences.py", "left"): "one of two arms, in a recorder's name",
    ("genpolicy/data/formats/consequences.py", "right"): "the same",
    ("genpolicy/execution/cell.py", "retreat"): "a primitive of recovery, not a phase",
    ("genpolicy/verification/recovering.py", "retreat"): "the same",
    ("gates/pages/plots_stress.py", "post"): "matplotlib: a step behind the point",
    ("gates/pages/plots_feasibility.py", "post"): "matplotlib: a step behind the point",
    ("genpolicy/evidence/shadow/rig.py", "approach"): "a phase of the rig's own",
    ("genpolicy/evidence/shadow/rig.py", "insert"): "a phase of the rig's own",
    ("genpolicy/evidence/shadow/mutants.py", "insert"): "a phase of the rig's own",
    ("genpolicy/evidence/shadow/voiding.py", "insert"): "a phase of the rig's own",
    ("genpolicy/evidence/shadow/clause_scenarios.py", "insert"): "a phase of the rig's own",
    ("genpolicy/evidence/shadow/clause_scenarios.py", "approach"): "a phase of the rig's own",
}
# Words inside the task's names that are plain words of robots, data or pages.
PLAIN = {
    "left": "a side",
    "right": "a side, and what is not wrong",
    "back": "a direction",
    "position": "where something is",
    "pose": "position and rotation",
    "rotation": "of a pose",
    "opening": "how far a gripper is open",
    "gripper": "a part of any arm that has one",
    "hand": "the same, and what a person writes with",
    "finger": "the same",
    "joint": "a part of any arm",
    "link": "the same",
    "torque": "a quantity of any joint",
    "wrench": "force and torque",
    "tcp": "tool centre point of any arm",
    "phase": "every task has some",
    "target": "a word of the task's protocol",
    "fixture": "a stored input whose output is known",
    "table": "of rows",
    "world": "truth under which power is computed",
    "floor": "smallest number that is reported",
    "m": "a unit",
    "n": "a unit, or a count",
}
# The same word with another meaning, or a part of something else, in one file.
WORDS = {
    ("gates/reproducibility/gate.py", "align"): "a verb, of configurations",
    ("gates/diagnosis/checkpoints.py", "retreat"): "a primitive of recovery, not a phase",
    ("genpolicy/audit/semantics/calibration.py", "release"): "the pose of reference is by "
    "definition that of what something is released into, in any task",
    ("genpolicy/data/formats/sampling.py", "grasp"): "a word by which columns are recognised",
    ("genpolicy/data/formats/units.py", "grasp"): "the same",
    ("gates/asked_for.py", "release"): "a corrupted fixture: a gripper that opens early",
    ("genpolicy/evidence/shadow/corruption.py", "release"): "a gripper that opens early",
    ("genpolicy/evidence/shadow/corruption.py", "approach"): "name of a check of contact",
    ("genpolicy/evidence/shadow/at_the_margin.py", "approach"): "the same",
    ("genpolicy/feasibility/reasons.py", "approach"): "the same",
    ("genpolicy/feasibility/layers/contact.py", "approach"): "the same",
    ("gates/asked_for.py", "approach"): "the same",
    ("gates/pages/reasons.py", "approach"): "the same",
    ("genpolicy/verification/contact.py", "approach"): "name of the proof's rule of the same",
    ("genpolicy/verification/contact.py", "release"): "the same, of letting go",
    ("genpolicy/evidence/shadow/layer_mutants.py", "approach"): "which rule stands behind a check",
    ("genpolicy/evidence/shadow/layer_mutants.py", "release"): "the same",
}


@cache
def names() -> frozenset[str]:
    """Bodies, sites, geoms, joints, phases, channels and modes of the tasks."""
    return frozenset().union(*map(names_of, TASKS))


def names_of(name: str) -> frozenset[str]:
    """The same of one task."""
    task = load_task(name)
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
    modes = {spec.mode for spec in task.episode_specs(0, 40)}
    return frozenset(of_scene | of_contract | modes) - {""}


def literals(path: Path) -> set[str]:
    """String literals of a module, without docstrings and words that place something in a plot."""
    tree = ast.parse(path.read_text())
    docs = {
        id(node.body[0].value)
        for node in ast.walk(tree)
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef)
        and node.body
        and isinstance(node.body[0], ast.Expr)
    } | {
        id(part)
        for node in ast.walk(tree)
        if isinstance(node, ast.keyword) and node.arg in PLACING
        for part in ast.walk(node.value)
    }
    return {
        node.value
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in docs
    }


def words(text: str) -> set[str]:
    """The words of a text or of a compound name, in small letters."""
    return {word.lower() for word in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+", text)}


def values(document: Any) -> Iterator[str]:
    """Every text of a parsed document, keys included."""
    if isinstance(document, dict):
        for key, value in document.items():
            yield from (str(key), *values(value))
    elif isinstance(document, list):
        for value in document:
            yield from values(value)
    elif isinstance(document, str):
        yield document


def texts(path: Path) -> set[str]:
    """What a file says: literals of a module, values of a document, a template without comments."""
    if path.suffix == ".py":
        return literals(path)
    if path.suffix == ".yaml":
        return set(values(yaml.safe_load(path.read_text())))
    return {re.sub(r"\{#.*?#\}", "", path.read_text(), flags=re.DOTALL)}


def outside() -> list[Path]:
    """Every module, packaged document and template that belongs to no task."""
    return [
        path
        for package in PACKAGES
        for path in sorted((ROOT / package).rglob("*"))
        if path.suffix in {".py", ".yaml", ".html"}
        and not any(f"tasks/{task}/" in path.as_posix() for task in TASKS)
    ]


@cache
def found() -> frozenset[tuple[str, str]]:
    """Every name of the task that stands outside its package: (file, name)."""
    return frozenset(
        (path.relative_to(ROOT).as_posix(), name)
        for path in outside()
        for name in texts(path) & names()
    )


@cache
def found_words() -> frozenset[tuple[str, str]]:
    """Every word of a name of the task that stands outside its package: (file, word)."""
    parts = set().union(*map(words, names()))
    return frozenset(
        (path.relative_to(ROOT).as_posix(), word)
        for path in outside()
        for word in set().union(*map(words, texts(path))) & parts
    )


def test_the_names_come_from_the_task_itself() -> None:
    expected = {"post", "peg", "link3", "grasp", "insert", "hole_pose", "finger_left", "torque7"}
    expected |= {"left", "right"}  # its modes
    assert expected <= names()


def test_nothing_outside_the_task_names_a_part_of_it() -> None:
    left = sorted(item for item in found() - set(LOCAL) if item[1] not in SHARED)
    assert left == [], "ask the task (genpolicy/tasks/api.py) instead of naming it"


def test_no_text_outside_the_task_holds_a_word_of_its_names() -> None:
    allowed = set(WORDS) | set(LOCAL)
    left = sorted(item for item in found_words() - allowed if item[1] not in {*PLAIN})
    assert left == [], "say it without the task, or list it with its reason"


def test_no_exception_outlives_its_need() -> None:
    assert sorted(set(LOCAL) - found()) == []
    assert sorted(set(SHARED) - {name for _, name in found()}) == []
    assert sorted(set(WORDS) - found_words()) == []
    assert sorted(set(PLAIN) - {word for _, word in found_words()}) == []


@pytest.mark.parametrize("word", ["insert", "post", "hole_pose"])
def test_words_of_the_task_alone_are_not_shared(word: str) -> None:
    assert word in names() and word not in {*SHARED, *PLAIN}
    assert not {"peg", "hole", "post", "insert", "align", "release"} & {*SHARED, *PLAIN}


def test_a_literal_is_found_and_a_docstring_is_not(tmp_path: Path) -> None:
    module = tmp_path / "m.py"
    module.write_text(
        '"""post"""\n# hole\ndef f(x="peg"):\n    "insert"\n    return {"align": 1}\n'
    )
    assert literals(module) & names() == {"peg", "align"}


def test_a_mode_is_found_and_a_place_in_a_plot_is_not(tmp_path: Path) -> None:
    module = tmp_path / "m.py"
    module.write_text('LEFT = "left"\naxes.text("a", ha="right" if low else "center")\n')
    assert literals(module) & names() == {"left"}


def test_sentences_documents_and_templates_are_read_word_by_word(tmp_path: Path) -> None:
    document, page = tmp_path / "limits.yaml", tmp_path / "page.html"
    document.write_text("# a post\nmodel:\n  of_the_peg: [0.1, the play of a hole]\n")
    page.write_text("<p>{# align #}Ready to insert.</p>")
    assert texts(document) == {"model", "of_the_peg", "the play of a hole"}
    assert {"peg", "hole"} <= set().union(*map(words, texts(document)))
    assert "insert" in words(*texts(page)) and "align" not in words(*texts(page))
    assert words("calibration_at_release") == {"calibration", "at", "release"}
