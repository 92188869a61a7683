"""The lock file that it writes is DVC's own, to the byte, and it is not read as DVC reads it."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from dvc.utils.serialize import _yaml

from flows.reproduce import QUICK_DVC

OWN = {"DVC_NO_ANALYTICS": "1"}
ODD = {
    "none": None, "tiny": 1e-05, "large": 1e22, "tenth": 0.10, "whole": 3.0, "no": False,
    "on": "on", "number": "017", "empty": {}, "many": [], "greek": "λ", "lines": "one\ntwo\n",
    "words": "a sentence: that is longer than a line, " * 4,
    "list": [{"a": 1, "b": [2, None]}, [1.5, "x"]],
}  # fmt: skip


@pytest.fixture
def pipeline(tmp_path: Path) -> Path:
    root = tmp_path / "repo"
    (root / ".dvc").mkdir(parents=True)
    (root / ".dvc" / "config").write_text("[core]\n    analytics = false\n    no_scm = true\n")
    stage = {"cmd": "cp in.txt out.txt", "deps": ["in.txt"], "outs": ["out.txt"]}
    stage |= {"params": list(ODD)}
    other = {"cmd": "true", "deps": ["out.txt"], "params": ["none", "last"]}
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
    """Written anew, with one stage of two changed, and with nothing to do."""
    lock = pipeline / "dvc.lock"
    for change in ({"last": 1}, {"last": 2.50}, {"last": None}, {}):
        (pipeline / "params.yaml").write_text(yaml.safe_dump(ODD | {"last": 1} | change))
        before = lock.read_bytes() if lock.exists() else None
        _repro(pipeline, "-m", "dvc")
        by_dvc = lock.read_bytes()
        assert by_dvc != before
        lock.unlink() if before is None else lock.write_bytes(before)
        assert "Running stage 'other'" in _repro(pipeline, "-P", str(QUICK_DVC))
        assert lock.read_bytes() == by_dvc
        assert "up to date" in _repro(pipeline, "-P", str(QUICK_DVC))
        assert lock.read_bytes() == by_dvc


def test_what_it_replaces_is_what_dvc_reads_a_lock_file_by() -> None:
    assert "parse_yaml_for_update" in _yaml.modify_yaml.__wrapped__.__code__.co_names
    program = f"""
import runpy, sys
import dvc.cli
from dvc.utils.serialize import _yaml
dvc.cli.main = lambda: print(_yaml.parse_yaml_for_update is _yaml.parse_yaml)
runpy.run_path({str(QUICK_DVC)!r}, run_name="__main__")
"""
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout) == (0, "True\n"), done.stderr
