"""A small ladder in a workspace of its own, copies of it, and what changed between two looks."""

import contextlib
import hashlib
import importlib
import io
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any
from unittest import mock

import pytest
import yaml

from flows.reproduce import RunEnd, reproduce, stage_environment
from flows.workspace import make_workspace
from gates.proof import SPECS
from genpolicy.compiled import cache_folder

ROOT = Path(__file__).parents[2]
OVERRIDES = Path(__file__).with_name("overrides.yaml")
REASON = "test: proves only that the pipeline runs"
DROPPED = {
    "train_baselines": ("samplers.bc", "samplers.ibc"),
    "train_factors": (
        "variants.newest_only", "variants.longer_history", "variants.l1_head",
        "variants.act_head",
    ),
    "train_generators": ("samplers.cvae",),
    "stress": tuple(
        f"perturbations.{name}"
        for name in ("compute_contention", "network_jitter", "queue_reorder", "push")
    ),
}  # fmt: skip

ALWAYS_RUN = ("task", "candidates")
UNFORMED = {
    "gate_c": {"controller": ("projection_p95_m", "boundary_jerk_p95_m_s3")},
    "gate_d": {
        "controller": ("latency_p95_s",),
        "safety": ("force_peak_p95_n", "recovery_success_lower"),
    },
}
"""Criteria that a handful of starts leaves without a verdict, whatever the limit."""
UNASKED = ("past.approach",)
"""Questions of the audit for which seventy episodes are too few."""
LEFT_ALONE = {
    "energy_head": {"name": "derivative_free", "steps": 16, "population": 64},
    "single_action": {"name": "direct"},
}
"""Samplers of variants whose baseline is dropped: they can take none from it."""


def make_small_ladder(target: Path) -> Path:
    """The checkout as a workspace with few of everything, and limits that nothing breaks."""
    overrides = yaml.safe_load(OVERRIDES.read_text())
    params = yaml.safe_load((ROOT / "params.yaml").read_text())
    for gate in "ABCD":
        widest = {
            item.id: [1e9 if item.comparison == "<=" else -1e9, REASON]
            for item in SPECS[gate].criteria
            if item.derived is None
        }
        name = f"gate_{gate.lower()}"
        overrides.setdefault(name, {})["limits"] = {
            owner: {key: widest[key] for key in entries if key in widest}
            for owner, entries in params[name]["limits"].items()
        }
    for gate, owners in UNFORMED.items():
        overrides[gate]["not_applicable"] = {
            owner: dict.fromkeys(names, REASON) for owner, names in owners.items()
        }
    overrides["gate_a"]["waived_checks"] = {"model": dict.fromkeys(UNASKED, REASON)}
    make_workspace(ROOT, target, overrides)
    # The same code, so that what it was compiled to is its own too; another process may be writing.
    unfinished = shutil.ignore_patterns("*.tmp.*")
    for part in ("feasibility", "policies"):
        compiled = cache_folder(ROOT / "genpolicy" / part / "kernels")
        if compiled.exists():  # those of the policies are imported where they are used
            shutil.copytree(compiled, target / compiled.relative_to(ROOT), ignore=unfinished)

    def drop(params: dict[str, Any]) -> None:
        for section, places in DROPPED.items():
            for place in places:
                name, key = place.split(".")
                del params[section][name][key]
        for name, sampler in LEFT_ALONE.items():
            params["train_factors"]["variants"][name]["sampler"] = sampler

    edit_params(target, drop)
    return target


def edit_params(workspace: Path, change: Callable[[dict[str, Any]], Any]) -> None:
    """Change `params.yaml` of a workspace."""
    path = workspace / "params.yaml"
    params = yaml.safe_load(path.read_text())
    change(params)
    path.write_text(yaml.safe_dump(params, sort_keys=False))


def set_limit(workspace: Path, gate: str, criterion: str, limit: float) -> None:
    """Move one limit."""

    def change(params: dict[str, Any]) -> None:
        for entries in params[gate]["limits"].values():
            if criterion in entries:
                entries[criterion][0] = limit

    edit_params(workspace, change)


def copy_of(workspace: Path, target: Path) -> Path:
    """An independent copy, with DVC's cache and lock; times are kept."""
    shutil.copytree(workspace, target, symlinks=True)
    return target


def repro(workspace: Path, *stages: str, **options: Any) -> tuple[RunEnd, list[str]]:
    """A real `dvc repro`; the outcome, and the stages that ran.

    Stages that run always are left out: a task may be installed outside the tree, and a policy may
    be brought from there.
    """
    lines: list[str] = []
    outcome = reproduce(workspace, stages=stages, echo=lines.append, **options)
    ran = [line.split("'")[1] for line in lines if line.startswith("Running stage '")]
    return outcome, [name for name in ran if name not in ALWAYS_RUN]


def run_stage(workspace: Path, name: str) -> tuple[int, str]:
    """`python -m stages.<name>` without DVC; exit code and what it said."""
    done = subprocess.run(
        [sys.executable, "-m", f"stages.{name}"],
        cwd=workspace,
        env=stage_environment(workspace),
        capture_output=True,
        text=True,
        check=False,
    )
    return done.returncode, last_words(name, done.stderr)


def run_here(workspace: Path, name: str) -> tuple[int, str]:
    """The same in this process: the checkout's code is the workspace's, and is imported once."""
    said = io.StringIO()
    stage = importlib.import_module(f"stages.{name}")
    with (
        mock.patch.dict(os.environ),
        contextlib.chdir(workspace),
        contextlib.redirect_stderr(said),
        pytest.raises(SystemExit) as end,
    ):
        stage.main(name, stage.work)
    assert isinstance(end.value.code, int)
    return end.value.code, last_words(name, said.getvalue())


def last_words(stage: str, said: str) -> str:
    """The last line that a stage said in its own name, or all that was said."""
    lines = [line for line in said.splitlines() if line.startswith(f"{stage}: ")]
    return lines[-1] if lines else said


def hashes(workspace: Path, *folders: str, leave: Iterable[str] = ()) -> dict[str, str]:
    """SHA-256 of every file below the folders, by path; `leave` names prefixes to leave out."""
    left = tuple(leave)
    return {
        name: hashlib.sha256(path.read_bytes()).hexdigest()
        for folder in folders
        for path in sorted((workspace / folder).rglob("*"))
        if path.is_file() and not (name := path.relative_to(workspace).as_posix()).startswith(left)
    }


def half_written(workspace: Path) -> list[str]:
    """Temporary files and locks that a dead writer left beside the artifacts."""
    return [path.name for path in (workspace / "artifacts").glob(".*")]


def flip_a_bit(path: Path) -> None:
    """Change one bit in the middle of a file; size and times stay."""
    times = path.stat()
    with path.open("r+b") as stream:
        stream.seek(times.st_size // 2)
        byte = stream.read(1)[0]
        stream.seek(-1, os.SEEK_CUR)
        stream.write(bytes([byte ^ 1]))
    os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))
