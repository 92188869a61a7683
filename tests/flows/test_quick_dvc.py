"""The lock file that it writes is DVC's own, to the byte, and it is written otherwise."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from dvc.dvcfile import ProjectFile

from flows.quick_dvc import spliced
from flows.reproduce import QUICK_DVC

OWN = {"DVC_NO_ANALYTICS": "1"}
ODD = {
    "none": None, "tiny": 1e-05, "large": 1e22, "tenth": 0.10, "whole": 3.0, "no": False,
    "on": "on", "number": "017", "empty": {}, "many": [], "greek": "λ", "lines": "one\ntwo\n",
    "words": "a sentence: that is longer than a line, " * 4,
    "list": [{"a": 1, "b": [2, None]}, [1.5, "x"]],
    "tree": {"z": {"leaf": [1]}, "b": {"c": 1}}, "wood": {"tree": {"x": [1]}},
}  # fmt: skip


@pytest.fixture
def pipeline(tmp_path: Path) -> Path:
    root = tmp_path / "repo"
    (root / ".dvc").mkdir(parents=True)
    (root / ".dvc" / "config").write_text("[core]\n    analytics = false\n    no_scm = true\n")
    stage = {"cmd": "cp in.txt out.txt", "deps": ["in.txt"], "outs": ["out.txt"]}
    stage |= {"params": [*ODD, "tree.b", "tree.z", "tree.z.leaf"]}
    other = {"cmd": "true", "deps": ["out.txt"], "params": ["none", "last", "wood", "wood.tree"]}
    (root / "dvc.yaml").write_text(yaml.safe_dump({"stages": {"first": stage, "other": other}}))
    (root / "in.txt").write_text("1")
    (root / "params.yaml").write_text(yaml.safe_dump(ODD | {"last": 1}))
    return root


def _repro(root: Path, *program: str) -> str:
    done = subprocess.run(
        [sys.executable, *program, "repro"],
        cwd=root, env={**os.environ, **OWN}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_a_lock_file_has_the_bytes_that_dvc_writes(pipeline: Path) -> None:
    """Written anew, with one stage of two changed, and with nothing to do.

    What a stage says twice is an anchor, numbered through the file: by `tree` and `wood` here.
    """
    lock = pipeline / "dvc.lock"
    for change in (
        {"last": 1}, {"last": 2.50}, {"last": None, "tree": {"z": {"leaf": 0}, "b": 1}},
        {"tree": {"z": {"leaf": [2]}, "b": {"c": 2}}}, {},
    ):  # fmt: skip
        (pipeline / "params.yaml").write_text(yaml.safe_dump(ODD | {"last": 1} | change))
        before = lock.read_bytes() if lock.exists() else None
        _repro(pipeline, "-m", "dvc")
        by_dvc = lock.read_bytes()
        assert by_dvc != before and b"*id001" in by_dvc
        lock.unlink() if before is None else lock.write_bytes(before)
        said = _repro(pipeline, "-P", str(QUICK_DVC))
        assert "Updating lock file" in said or (before is None and "Generating lock file" in said)
        assert not list(pipeline.glob(".dvc.lock*"))
        assert lock.read_bytes() == by_dvc
        assert "up to date" in _repro(pipeline, "-P", str(QUICK_DVC))
        assert lock.read_bytes() == by_dvc


def test_a_lock_file_of_another_form_is_left_to_dvc(pipeline: Path) -> None:
    """As one with a comment, which DVC keeps, or with a stage that nobody ran."""
    lock = pipeline / "dvc.lock"
    _repro(pipeline, "-P", str(QUICK_DVC))
    text = f"# mine\n{lock.read_text()}"
    (pipeline / "in.txt").write_text("2")
    lock.write_text(text)
    _repro(pipeline, "-m", "dvc")
    by_dvc = lock.read_text()
    assert by_dvc.startswith("# mine\n") and by_dvc != text
    lock.write_text(text)
    _repro(pipeline, "-P", str(QUICK_DVC))
    assert lock.read_text() == by_dvc


def test_a_stage_is_put_where_it_stood_or_behind_all_others() -> None:
    stages = "  a:\n    cmd: x\n  'on':\n    cmd: |\n      y\n\n      z\n  ab:\n    cmd: w\n"
    changed = spliced(stages, "  'on':\n    cmd: v\n")
    assert yaml.safe_load(changed) == {"a": {"cmd": "x"}, "on": {"cmd": "v"}, "ab": {"cmd": "w"}}
    assert list(yaml.safe_load(changed)) == ["a", "on", "ab"]
    assert spliced(stages, "  b:\n    cmd: v\n") == f"{stages}  b:\n    cmd: v\n"


def test_what_it_replaces_is_what_dvc_writes_a_lock_file_by() -> None:
    program = f"""
import runpy, sys
import dvc.cli, dvc.dvcfile
whole = dvc.dvcfile.Lockfile.dump_stages
dvc.cli.main = lambda: print(dvc.dvcfile.Lockfile.dump_stages is whole)
runpy.run_path({str(QUICK_DVC)!r}, run_name="__main__")
"""
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout) == (0, "False\n"), done.stderr
    assert "dump_stages" in ProjectFile._dump_lockfile.__code__.co_names
