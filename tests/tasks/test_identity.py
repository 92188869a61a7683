"""The identity of a task changes with whatever makes it this task, and with nothing else."""

import dataclasses
import sys
from importlib.metadata import EntryPoint

import numpy as np
import pytest

from genpolicy.documents.task import IDENTITY
from genpolicy.errors import ConfigError
from genpolicy.integrity.documents import canonical_json
from genpolicy.integrity.hashing import sha256_bytes
from genpolicy.robot.limits import FR3, PANDA
from genpolicy.tasks import identity
from genpolicy.tasks.identity import limits_sha256, package_files, task_identity


def test_the_default_task_is_itself_every_time():
    first, second = task_identity("tabletop_insertion"), task_identity("tabletop_insertion")
    assert canonical_json(first) == canonical_json(second)
    assert {"scene.xml", "task.py", "world.py"} <= set(first["package"])
    assert first["package"]["scene.xml"] == first["scene_sha256"]
    assert first["robot"] == "panda"
    assert first["distribution"]["name"] == "genpolicy"
    body = {key: value for key, value in first.items() if key != "sha256"}
    assert sha256_bytes(canonical_json(body)) == first["sha256"]
    assert IDENTITY.plain(IDENTITY.parse(first, where=IDENTITY.file)) == first


@pytest.mark.parametrize("file", ["task.py", "arm.xml", "notes.txt"])
def test_an_edit_of_a_task_outside_the_tree_is_seen(foreign_task, foreign_folder, file):
    before = task_identity(foreign_task)
    path = foreign_folder / file
    kept = path.read_bytes() if path.exists() else None
    try:
        path.write_bytes((kept or b"") + b"\n")
        after = task_identity(foreign_task)
    finally:
        if kept is None:
            path.unlink()
        else:
            path.write_bytes(kept)
    assert after["sha256"] != before["sha256"]
    assert set(before["package"]) <= set(after["package"])
    assert task_identity(foreign_task) == before


def test_compiled_files_are_no_part_of_it(foreign_task, foreign_folder):
    before = task_identity(foreign_task)
    (foreign_folder / "__pycache__").mkdir(exist_ok=True)
    (foreign_folder / "__pycache__" / "other.cpython-311.pyc").write_bytes(b"x")
    assert task_identity(foreign_task) == before


def test_a_robot_table_is_its_figures_and_its_source():
    assert limits_sha256(PANDA) != limits_sha256(FR3)
    assert limits_sha256(PANDA) != limits_sha256(dataclasses.replace(PANDA, source="other"))
    slower = dataclasses.replace(PANDA, velocity_rad_s=np.nextafter(PANDA.velocity_rad_s, 0))
    assert limits_sha256(slower) != limits_sha256(PANDA)


def test_a_single_module_is_its_own_file(tmp_path, monkeypatch):
    (tmp_path / "lone_task.py").write_text("TASK = None\n")
    (tmp_path / "beside.txt").write_text("not of the task\n")
    monkeypatch.setattr(sys, "path", [str(tmp_path), *sys.path])
    point = EntryPoint("lone", "lone_task:TASK", "genpolicy.tasks")
    assert list(package_files(point)) == ["lone_task.py"]


def test_a_module_that_is_gone_is_named():
    point = EntryPoint("lost", "no_such_module_at_all:TASK", "genpolicy.tasks")
    with pytest.raises(ConfigError, match="the task lost is registered as no_such_module_at_all"):
        package_files(point)


@pytest.mark.parametrize(
    ("member", "value", "words"),
    [
        ("contact_phases", frozenset({"weld"}), r"contact_phases is \['weld'\]"),
        ("limits", PANDA, "limits is of 7 joints, expected 6"),
    ],
)
def test_a_task_that_contradicts_itself_is_refused(foreign_task, monkeypatch, member, value, words):
    task = identity.load_task(foreign_task)
    changed = type("Changed", (type(task),), {member: value})()
    monkeypatch.setattr(identity, "load_task", lambda name: changed)
    with pytest.raises(ConfigError, match=words):
        task_identity(foreign_task)
