"""Whole or absent: folders and files under failure, and one writer at a time."""

import errno
import os
import signal
import subprocess
import sys
import time

import pytest

from genpolicy.errors import BadInputError
from genpolicy.integrity.atomic import output_folder, write_bytes


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_folder_appears_whole_and_replaces_the_old_one(tmp_path):
    out = tmp_path / "deep" / "out"
    for content in ("one", "two"):
        with output_folder(out) as folder:
            (folder / content).write_text(content)
            assert not out.exists()
        assert names(out) == [content]
    assert names(out.parent) == ["out"]


@pytest.mark.parametrize("kind", [ValueError, KeyboardInterrupt])
def test_failure_leaves_nothing(tmp_path, kind):
    with pytest.raises(kind), output_folder(tmp_path / "out") as folder:
        (folder / "half").write_text("half")
        raise kind
    assert names(tmp_path) == []


def test_a_file_or_link_in_the_way_is_replaced(tmp_path):
    (tmp_path / "out").write_text("x")
    with output_folder(tmp_path / "out") as folder:
        (folder / "a").touch()
    (tmp_path / "link").symlink_to(tmp_path / "out")
    with output_folder(tmp_path / "link") as folder:
        (folder / "b").touch()
    assert names(tmp_path / "out") == ["a"]
    assert names(tmp_path / "link") == ["b"]


def test_an_error_of_the_blocks_own_reading_keeps_its_name(tmp_path):
    with pytest.raises(FileNotFoundError), output_folder(tmp_path / "out"):
        (tmp_path / "absent").read_bytes()
    with pytest.raises(ConnectionResetError), output_folder(tmp_path / "out"):
        raise ConnectionResetError(errno.ECONNRESET, "peer")
    assert names(tmp_path) == []


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EROFS, errno.EFBIG, errno.EDQUOT])
def test_an_error_of_its_writing_names_the_folder(tmp_path, number):
    with pytest.raises(BadInputError, match="out is not writable"), output_folder(tmp_path / "out"):
        raise OSError(number, "refused")
    with (
        pytest.raises(BadInputError, match="out is not writable"),
        output_folder(tmp_path / "out") as folder,
    ):
        (folder / "missing" / "file").write_text("x")
    assert names(tmp_path) == []


def test_second_writer_is_refused_and_the_first_goes_on(tmp_path):
    out = tmp_path / "out"
    with output_folder(out) as folder:
        (folder / "first").touch()
        with (
            pytest.raises(BadInputError, match=r"\.out\.lock is held") as caught,
            output_folder(out),
        ):
            raise AssertionError("two writers")
        assert caught.value.exit_code == 2
        with output_folder(tmp_path / "other") as other:
            (other / "free").touch()
    assert names(out) == ["first"]
    assert names(tmp_path) == ["other", "out"]


HOLDER = """
import sys, time
from pathlib import Path
from genpolicy.integrity.atomic import output_folder
with output_folder(Path(sys.argv[1])) as folder:
    (folder / "half").write_text("half")
    print("writing", flush=True)
    time.sleep(60)
"""


def test_a_killed_writer_frees_the_lock_and_its_rest_is_swept(tmp_path):
    out = tmp_path / "out"
    holder = subprocess.Popen([sys.executable, "-c", HOLDER, str(out)], stdout=subprocess.PIPE)
    try:
        assert holder.stdout.readline() == b"writing\n"
        with pytest.raises(BadInputError, match="held by another process"), output_folder(out):
            pass
        os.kill(holder.pid, signal.SIGKILL)
        holder.wait()
        time.sleep(0)
        assert not out.exists()
        with output_folder(out) as folder:
            (folder / "whole").touch()
        assert names(tmp_path) == ["out"]
        assert names(out) == ["whole"]
    finally:
        holder.kill()
        holder.wait()
        holder.stdout.close()


def test_write_bytes_keeps_the_old_file_when_it_fails(tmp_path, monkeypatch):
    path = tmp_path / "file"
    write_bytes(path, b"old")

    def full(descriptor):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(BadInputError, match="file is not writable"):
        write_bytes(path, b"new")
    assert path.read_bytes() == b"old"
    assert names(tmp_path) == ["file"]


def test_place_below_a_file(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(BadInputError, match="not writable"), output_folder(tmp_path / "file" / "x"):
        pass
    with pytest.raises(BadInputError, match="not writable"):
        write_bytes(tmp_path / "file" / "x", b"")
