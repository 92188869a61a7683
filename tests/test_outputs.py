"""Files of somebody in a stage's folder: told apart from what stages wrote, and never lost."""

import json
import os
import shutil

import pytest

from gates.pipeline import Disk
from genpolicy.errors import BadInputError
from genpolicy.outputs import require_own_files

OWN = {"modes.parquet": b"modes", "journals/a.mcap": b"a"}


@pytest.fixture
def root(tmp_path):
    """A folder that a recorded run wrote, with DVC's cache of it, and one file beside it."""
    write(tmp_path, "audit", OWN)
    write(tmp_path, "gate_a", {"verdict.json": b"{}", "criteria.csv": b"id"})
    (tmp_path / "dvc.yaml").write_text(
        json.dumps(
            {
                "stages": {
                    "audit": {"cmd": "x", "outs": ["artifacts/audit"]},
                    "gate_a": {
                        "cmd": "x",
                        "outs": ["artifacts/gate_a/verdict.json"],
                        "plots": [{"artifacts/gate_a/criteria.csv": {"x": "criterion"}}],
                    },
                }
            }
        )
    )
    record(tmp_path)
    return tmp_path


def write(root, stage, files):
    for name, data in files.items():
        path = root / "artifacts" / stage / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)


def cache(root, data, suffix=""):
    """Bytes as DVC keeps them; returns their name."""
    file = root / "bytes"
    file.write_bytes(data)
    md5 = Disk(root, {}).md5("bytes") + suffix
    kept = root / ".dvc/cache/files/md5" / md5[:2] / md5[2:]
    kept.parent.mkdir(parents=True, exist_ok=True)
    file.replace(kept)
    return md5


def record(root):
    """Lock and cache as after runs that wrote what lies there."""
    files = sorted(OWN)
    listing = [{"md5": cache(root, OWN[name]), "relpath": name} for name in files]
    cache(root, json.dumps(listing, sort_keys=True).encode(), ".dir")
    paths = ("artifacts/audit", "artifacts/gate_a/verdict.json", "artifacts/gate_a/criteria.csv")
    outs = [{"path": path, "md5": Disk(root, {}).md5(path)} for path in paths]
    outs[0]["nfiles"] = len(OWN)
    runs = {"audit": {"outs": outs[:1]}, "gate_a": {"outs": outs[1:]}}
    (root / "dvc.lock").write_text(json.dumps({"schema": "2.0", "stages": runs}))


def ended(root, stage, code=0):
    path = root / "build/times" / f"{stage}.json"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps({"stage": stage, "exit_code": code}))
    return path


@pytest.mark.parametrize(
    "name",
    ["audit/notes.txt", "audit/journals/mine.mcap", "audit/a.tmp.1", "gate_a/notes.txt"],
)
def test_a_file_of_somebody_is_named_and_stays(root, name):
    require_own_files(root)
    path = root / "artifacts" / name
    path.write_bytes(b"mine")
    with pytest.raises(BadInputError, match=rf"artifacts/{name} is a file that .* did not write"):
        require_own_files(root)
    assert path.read_bytes() == b"mine"


@pytest.mark.parametrize("to", ["audit/modes.parquet", "audit/journals", "nowhere"])
def test_a_link_is_no_output(root, to):
    (root / "artifacts/audit/link").symlink_to(root / "artifacts" / to)
    with pytest.raises(BadInputError, match="audit/link"):
        require_own_files(root)


def test_an_output_that_was_edited_or_removed_is_written_again(root):
    """`dvc repro` is how it is repaired."""
    write(root, "audit", {"modes.parquet": b"edited"})
    (root / "artifacts/audit/journals/a.mcap").unlink()
    require_own_files(root)


def test_what_the_cache_holds_is_not_lost(root):
    """An output of another version: its name is no longer written, its bytes are kept."""
    write(root, "audit", {"older.parquet": b"an earlier run"})
    with pytest.raises(BadInputError, match=r"older\.parquet"):
        require_own_files(root)
    cache(root, b"an earlier run")
    require_own_files(root)


@pytest.mark.parametrize("place", ["../elsewhere", None])
def test_a_cache_that_lies_elsewhere_is_found(root, tmp_path, place):
    where = place or str(tmp_path / "elsewhere")
    (root / ".dvc/cache").rename(root / "elsewhere")
    with pytest.raises(BadInputError):
        write(root, "audit", {"modes2.parquet": b"modes"})
        require_own_files(root)
    (root / ".dvc/config.local").write_text(f"[cache]\n    dir = {where}\n")
    require_own_files(root)


def test_without_the_cache_more_files_than_were_written_stop_the_ladder(root):
    shutil.rmtree(root / ".dvc")
    write(root, "audit", {"modes.parquet": b"edited"})
    require_own_files(root)
    (root / "artifacts/audit/notes.txt").write_bytes(b"mine")
    with pytest.raises(BadInputError, match=r"artifacts/audit/notes\.txt"):
        require_own_files(root)


def test_what_lay_there_when_the_stage_ended_is_its_own(root):
    """DVC was stopped after the stage, and before it recorded what it wrote."""
    (root / "dvc.lock").unlink()
    shutil.rmtree(root / ".dvc")
    with pytest.raises(BadInputError, match="artifacts/audit/"):
        require_own_files(root)
    ended(root, "audit"), ended(root, "gate_a")
    require_own_files(root)
    ended(root, "audit", code=2)
    with pytest.raises(BadInputError, match="artifacts/audit/"):
        require_own_files(root)


def test_an_old_file_that_is_moved_there_later_is_nobody_elses(root):
    mine = root / "mine.txt"
    mine.write_bytes(b"mine")
    os.utime(mine, (0, 0))
    record_of = ended(root, "audit")
    now = record_of.stat().st_mtime_ns
    mine.rename(root / "artifacts/audit/mine.txt")
    os.utime(record_of, ns=(now - 10**9, now - 10**9))
    with pytest.raises(BadInputError, match=r"mine\.txt"):
        require_own_files(root)


def test_where_no_pipeline_or_no_folder_is_nothing_is_asked(tmp_path):
    require_own_files(tmp_path)
    (tmp_path / "dvc.yaml").write_text("stages:\n  audit: {cmd: x, outs: [artifacts/audit]}\n")
    require_own_files(tmp_path)


@pytest.mark.parametrize(
    ("name", "text"),
    [("dvc.lock", "stages: {audit: {outs: [x, 1]}}"), ("dvc.lock", "stages: {audit: {outs: x}}"),
     ("dvc.lock", "stages: [1]"), ("dvc.yaml", "1"), (".dvc/config", "[cache")],
)  # fmt: skip
def test_what_dvc_itself_refuses_is_left_to_it(root, name, text):
    ended(root, "audit"), ended(root, "gate_a")
    (root / name).write_text(text)
    require_own_files(root)
