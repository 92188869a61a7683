"""A recorded run stands where all that it read is what the runs below it wrote."""

import hashlib

import pytest
import yaml

from gates.present import present_runs
from genpolicy.errors import IntegrityError


def lock(root, **runs):
    (root / "dvc.lock").write_text(yaml.safe_dump({"schema": "2.0", "stages": runs}))
    return present_runs(root)


def run(*, reads=(), writes=()):
    return {
        "deps": [{"path": path, "md5": md5} for path, md5 in reads],
        "outs": [{"path": path, "md5": md5} for path, md5 in writes],
    }


TASK = run(writes=[("artifacts/task", "t1")])


def test_without_a_lock_file_nothing_is_known(tmp_path):
    assert present_runs(tmp_path) is None


@pytest.mark.parametrize(("read", "stands"), [("t1", {"a", "task"}), ("t0", {"task"})])
def test_a_run_stands_on_what_the_one_below_wrote_last(tmp_path, read, stands):
    assert lock(tmp_path, task=TASK, a=run(reads=[("artifacts/task", read)])) == stands


def test_each_thing_read_counts_and_each_file_written_has_its_own_bytes(tmp_path):
    task = run(writes=[("one", "1"), ("two", "2")])
    good = run(reads=[("two", "2"), ("one", "1")])
    assert lock(tmp_path, task=task, a=good) == {"task", "a"}
    for swapped in ([("one", "2")], [("two", "2"), ("one", "2")], [("one", "2"), ("two", "2")]):
        assert lock(tmp_path, task=task, a=run(reads=swapped)) == {"task"}


def test_what_no_stage_wrote_is_code_or_brought_along(tmp_path):
    brought = run(reads=[("artifacts/taskless", "x"), ("code.py", "y")])
    assert lock(tmp_path, task=TASK, a=brought) == {"task", "a"}


def test_a_run_on_one_that_does_not_stand_does_not_stand(tmp_path):
    a = run(reads=[("artifacts/task", "t0")], writes=[("a", "1")])
    b = run(reads=[("a", "1")], writes=[("b", "1")])
    assert lock(tmp_path, task=TASK, b=b, a=a, c=run(reads=[("b", "1")])) == {"task"}
    a = run(reads=[("artifacts/task", "t1")], writes=[("a", "1")])
    assert lock(tmp_path, c=run(reads=[("b", "1")]), b=b, a=a, task=TASK) == {*"abc", "task"}


def test_a_run_that_reads_what_it_writes_stands_on_nothing(tmp_path):
    own = run(reads=[("a", "1")], writes=[("a", "1")])
    assert lock(tmp_path, task=TASK, a=own) == {"task"}


def test_a_file_inside_what_was_written_is_compared_by_its_bytes(tmp_path):
    file = tmp_path / "artifacts/task/identity.json"
    file.parent.mkdir(parents=True)
    file.write_text("{}")
    read = run(reads=[("artifacts/task/identity.json", hashlib.md5(b"{}").hexdigest())])
    stale = run(reads=[("artifacts/task", "t0")], writes=[("artifacts/task", "t1")])
    assert lock(tmp_path, task=TASK, a=read) == {"task", "a"}
    assert lock(tmp_path, task=stale, a=read) == set()
    file.write_text("[]")
    assert lock(tmp_path, task=TASK, a=read) == {"task"}
    file.unlink()
    file.symlink_to(tmp_path / "dvc.lock")
    with pytest.raises(IntegrityError):
        lock(tmp_path, task=TASK, a=read)


def test_a_run_that_names_nothing_reads_nothing(tmp_path):
    assert lock(tmp_path, task=TASK, a={}, b={"deps": None, "outs": None}) == {"task", "a", "b"}
