"""Places that cannot be written: exit 2, one sentence, nothing left."""

import ctypes
import fcntl
import os
import resource
import shutil
from pathlib import Path

import pytest
import yaml

from genpolicy.tasks.fixtures import PINS

ROOT = Path(__file__).parents[2]
PR_CAPBSET_DROP, CAP_DAC_OVERRIDE = 24, 1
FULL_BYTES = 48 * 1024


def few(workers=1):
    def change(params):
        params["record"]["episodes"] = 6
        params["compute"]["workers"] = workers

    return change


def full_disk():
    """The system then fails every write beyond this size, like a disk without space."""
    resource.setrlimit(resource.RLIMIT_FSIZE, (FULL_BYTES, FULL_BYTES))


def without_override():
    """Permissions then hold for root too."""
    if os.geteuid() == 0:
        ctypes.CDLL(None).prctl(PR_CAPBSET_DROP, CAP_DAC_OVERRIDE, 0, 0, 0)


@pytest.fixture(scope="session")
def recorded(tmp_path_factory, process):
    """A workspace with the task's identity and six recordings."""
    folder = tmp_path_factory.mktemp("recorded")
    params = yaml.safe_load((ROOT / "params.yaml").read_text())
    few()(params)
    (folder / "params.yaml").write_text(yaml.safe_dump(params))
    shutil.copy(ROOT / PINS, folder)
    for stage in ("task", "record"):
        code, said = process(stage, folder)
        assert code == 0, said
    return folder


@pytest.mark.parametrize("workers", [1, 2])
def test_a_full_disk_while_recording_leaves_nothing(workspace, edit, process, workers) -> None:
    edit(workspace, few(workers))
    code, said = process("record", workspace, preexec_fn=full_disk)
    assert code == 2, said
    assert said.count("\n") == 1
    assert "is not writable (File too large), expected a writable place with free space" in said
    assert list((workspace / "artifacts").iterdir()) == []


@pytest.mark.parametrize("name", ["ingest", "audit"])
def test_a_full_disk_leaves_no_half_dataset(recorded, tmp_path, process, name) -> None:
    target = tmp_path / "run"
    shutil.copytree(recorded, target)
    if name == "audit":
        assert process("ingest", target)[0] == 0
    before = {path.name for path in (target / "artifacts").iterdir()}
    limit = 4096 if name == "audit" else FULL_BYTES

    def full():
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

    code, said = process(name, target, preexec_fn=full)
    assert code == 2, said
    last = said.splitlines()[-1]  # behind what a slow machine says of its progress
    assert last.startswith(f"{name}: artifacts/") and "not writable (File too large)" in last
    assert {path.name for path in (target / "artifacts").iterdir()} == before


def test_a_full_disk_while_judging_leaves_no_verdict(workspace, process) -> None:
    def full():
        resource.setrlimit(resource.RLIMIT_FSIZE, (1024, 1024))

    code, said = process("gate_a", workspace, preexec_fn=full)
    assert code == 2, said
    assert "gate_a: " in said and "not writable (File too large)" in said
    left = [p for folder in ("artifacts", "reports") for p in (workspace / folder).rglob("*")]
    assert [path for path in left if path.is_file()] == []


def test_a_read_only_place_is_named(workspace, process) -> None:
    """Without the privilege of root to write anywhere."""
    artifacts = workspace / "artifacts"
    artifacts.mkdir()
    artifacts.chmod(0o555)
    workspace.chmod(0o555)
    try:
        code, said = process("record", workspace, preexec_fn=without_override)
    finally:
        artifacts.chmod(0o755)
        workspace.chmod(0o755)
    assert code == 2, said
    assert "record: artifacts/record is not writable (Permission denied)" in said
    assert "record: time not recorded (Permission denied)" in said
    assert list(artifacts.iterdir()) == []


def test_a_file_in_place_of_the_folder_is_named(workspace, edit, stage) -> None:
    edit(workspace, few())
    (workspace / "artifacts").write_text("in the way")
    code, said = stage("record")
    assert (code, said.count("\n")) == (2, 1)
    assert said.startswith("record: artifacts/record is not writable (")
    assert (workspace / "artifacts").read_text() == "in the way"


def test_a_second_writer_is_kept_out(workspace, edit, stage) -> None:
    edit(workspace, few())
    (workspace / "artifacts").mkdir()
    with (workspace / "artifacts" / ".record.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        code, said = stage("record")
    assert (code, said.count("\n")) == (2, 1)
    assert "artifacts/.record.lock is held by another process that writes the same folder" in said
