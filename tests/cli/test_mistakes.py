"""Mistakes on the command line: one sentence, exit code 2, nothing written, nothing heavy loaded.

Each is told before the readers are imported: the modules that read are not to be had here.
"""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from gates.audit import command
from genpolicy.cli.main import main
from genpolicy.data import assemble
from genpolicy.data.formats import detect
from genpolicy.data.formats.ends import check_ends
from genpolicy.errors import IntegrityError

READERS = (
    "gates.audit.command",
    "gates.audit.importing",
    "genpolicy.cli.ingest",
    "genpolicy.data.formats.opening",
)
HEAVY = ("torch", "pandas", "mujoco", "matplotlib", "numpy", "scipy", "sklearn", "pyarrow", "h5py")
PARQUET = b"PAR1" + bytes(40) + (20).to_bytes(4, "little") + b"PAR1"
# Version 0: three addresses of eight bytes from byte 24 on, the third that of the end.
HDF5 = detect.HDF5_MAGIC + bytes(5) + b"\x08\x08" + bytes(25) + (96).to_bytes(8, "little")
HDF5 += bytes(96 - len(HDF5))
MCAP = 2 * detect.MCAP_MAGIC
WHOLE = {"x.parquet": PARQUET, "x.hdf5": HDF5, "x.mcap": MCAP}
HUGE = 300 * 10**9


def lay(root: Path, *names: str, data: bytes = b""):
    for name in names:
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data or WHOLE.get(f"x{path.suffix}", b"text"))


def sparse(path: Path, head: bytes, tail: bytes = b""):
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("wb") as stream:
        stream.write(head)
        stream.truncate(HUGE)
        if tail:
            stream.seek(HUGE - len(tail))
            stream.write(tail)


SCENES = {
    "missing": (lambda r: None, "recordings is missing"),
    "empty": (lambda r: r.mkdir(), "of no known layout (it holds no file)"),
    "csv only": (lambda r: lay(r, "a.csv", "b.csv"), "(it holds 2 .csv)"),
    "parquet and hdf5": (lambda r: lay(r, "a.parquet", "b.hdf5"),
                         "several layouts at once (parquet: a.parquet; robomimic: b.hdf5)"),
    "mcap below parquet": (lambda r: lay(r, "a.parquet", "raw/b.mcap"), "mcap: raw/b.mcap"),
    "lerobot and hdf5": (lambda r: lay(r, "meta/info.json", "data/a.parquet", "raw/b.h5"),
                         "a LeRobot dataset that also holds raw/b.h5"),
    "above lerobot": (lambda r: lay(r, "push/meta/info.json", "push/data/a.parquet",
                                    "pick/meta/info.json", "pick/data/a.parquet"),
                      "a folder above 2 data sets (pick, push)"),
    "above one": (lambda r: lay(r, "push/meta/info.json", "push/data/a.parquet", "b.parquet"),
                  "a folder above 1 data set (push, beside b.parquet)"),
    "above zarr and ours": (lambda r: lay(r, "a.zarr/.zgroup", "d/manifest.json",
                                          "d/frames.parquet"), "2 data sets (a.zarr, d)"),
    "above hdf5": (lambda r: lay(r, "a.hdf5", "b.hdf5"), "a folder of 2 HDF5 files (a.hdf5, b"),
    "one cut hdf5": (lambda r: lay(r, "a.hdf5", "notes.txt", data=HDF5[:-9]), "a.hdf5 is cut off"),
    "above parquet": (lambda r: lay(r, "push/a.parquet", "pick/a.parquet"),
                      "they lie in 2 folders (pick, push)"),
    "above mcap": (lambda r: lay(r, "push/a.mcap", "pick/a.mcap"), "2 folders (pick, push)"),
}  # fmt: skip
FILES = {
    "a.csv": (lambda p: lay(p.parent, p.name), "of no known layout (a .csv file)"),
    "a.parquet": (lambda p: p.write_bytes(PARQUET[:-4]), "cut off: 48 bytes without a footer"),
    "b.parquet": (lambda p: p.write_bytes(b"ARROW1" + PARQUET), "does not begin as Parquet"),
    "c.parquet": (lambda p: p.write_bytes(b""), "empty"),
    "d.parquet": (lambda p: sparse(p, b"PAR1"), "without a footer"),
    "e.parquet": (lambda p: sparse(p, b"PAR1", b"\xff\xff\xff\xff" + b"PAR2"), "without a footer"),
    "a.hdf5": (lambda p: p.write_bytes(HDF5[:-1]), "cut off: 95 bytes"),
    "b.hdf5": (lambda p: p.write_bytes(b"text"), "does not begin as HDF5"),
    "c.hdf5": (lambda p: sparse(p, detect.HDF5_MAGIC), "cut off"),
    "d.hdf5": (lambda p: sparse(p, b""), "does not begin as HDF5"),
    "e.hdf5": (lambda p: sparse(p, HDF5), "300000000000 bytes long, expected 96 bytes"),
    "a.mcap": (lambda p: p.write_bytes(MCAP[:-1]), "cut off or still being written"),
}
COMMANDS = ("audit", "ingest", "propose")


@pytest.fixture(autouse=True)
def nothing_is_read(monkeypatch):
    """What would read the recordings cannot be imported: that ends in code 1."""
    for name in READERS:
        monkeypatch.setitem(sys.modules, name, None)


@pytest.fixture
def place(tmp_path, monkeypatch):
    folder = tmp_path / "place"
    folder.mkdir()
    monkeypatch.chdir(folder)
    return folder


def refused(command, path, out, capsys, *more):
    """The one line that the command prints; asserts that nothing else happened."""
    before = listing(Path())
    capsys.readouterr()
    assert main([command, str(path), "--out", str(out), *more]) == 2
    printed = capsys.readouterr()
    lines = printed.err.splitlines()
    assert len(lines) == 1 and printed.out == ""
    assert lines[0].startswith(f"genpolicy {command}: ")
    assert listing(Path()) == before
    return lines[0]


def listing(folder):
    return sorted(
        (str(path), path.lstat().st_size, path.lstat().st_mtime_ns) for path in folder.rglob("*")
    )


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("name", SCENES)
def test_folders(name, command, place, capsys):
    make, said = SCENES[name]
    make(place / "recordings")
    assert said in refused(command, "recordings", "out", capsys)


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("name", FILES)
def test_files(name, command, place, capsys):
    make, said = FILES[name]
    make(place / name)
    assert said in refused(command, name, "out", capsys)


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("out", ["recordings", "recordings/sub/out", "."])
def test_output_in_or_around_the_recordings(out, command, place, capsys):
    lay(place / "recordings", "a.parquet")
    said = refused(command, "recordings", out, capsys, *["--force"] * (command == "propose"))
    assert "never written to" in said


def test_a_recording_is_not_replaced_by_its_own_contract(place, capsys):
    lay(place, "a.parquet")
    assert "never written to" in refused("propose", "a.parquet", "a.parquet", capsys, "--force")


@pytest.mark.parametrize("command", ["audit", "ingest"])
@pytest.mark.parametrize("out", ["thesis", "thesis/thesis.tex", "link"])
def test_output_that_is_there(out, command, place, capsys):
    lay(place, "a.parquet", "thesis/thesis.tex")
    (place / "link").symlink_to("thesis")
    refused(command, "a.parquet", out, capsys)


def test_a_contract_that_is_there(place, capsys):
    lay(place, "a.parquet", "c.yaml", "folder/x.txt")
    assert "or give --force" in refused("propose", "a.parquet", "c.yaml", capsys)
    assert "a folder" in refused("propose", "a.parquet", "folder", capsys, "--force")


@pytest.mark.parametrize("option", ["--contract", "--limits"])
def test_files_that_options_name(option, place, capsys):
    lay(place, "a.parquet")
    said = refused("audit", "a.parquet", "out", capsys, option, "absent.yaml")
    assert f"{option} absent.yaml is missing" in said
    assert "not a file" in refused("audit", "a.parquet", "out", capsys, option, str(place))


def test_files_that_options_name_and_that_hold_no_settings(place, capsys):
    lay(place, "a.parquet", "words.yaml")
    lay(place, "other.yaml", data=b"a: 1")
    lay(place, "broken.yaml", data=b"a: [1")
    for option in ("--contract", "--limits"):
        said = refused("audit", "a.parquet", "out", capsys, option, "words.yaml")
        assert f"{option} words.yaml is no mapping" in said
        assert "broken.yaml" in refused("audit", "a.parquet", "out", capsys, option, "broken.yaml")
    said = refused("audit", "a.parquet", "out", capsys, "--limits", "other.yaml")
    assert "--limits other.yaml is without the section gate_a" in said


NAMED_WRONGLY = {
    "robomimic": (lambda r: lay(r, "a.hdf5", "b.h5"), "a folder, expected one HDF5 file"),
    "lerobot": (lambda r: lay(r, "a.parquet"), "without meta/info.json"),
    "parquet": (lambda r: lay(r, ".zgroup", "data/a/.zarray"), "without a .parquet file"),
    "mcap": (lambda r: lay(r, "a.parquet"), "without a .mcap file"),
    "zarr": (lambda r: lay(r.parent, r.name), "a file, expected a folder of Zarr arrays"),
}


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("layout", NAMED_WRONGLY)
def test_a_layout_that_is_named_and_is_not_there(layout, command, place, capsys):
    make, said = NAMED_WRONGLY[layout]
    make(place / "recordings")
    assert said in refused(command, "recordings", "out", capsys, "--format", layout)


def test_a_layout_that_is_named_is_looked_for_in_data_sets_below(place):
    lay(place / "all", "push/meta/info.json", "push/data/a.parquet")
    detect.check_named(place / "all", "parquet")


@pytest.mark.parametrize("command", COMMANDS)
def test_output_below_a_file(command, place, capsys):
    lay(place, "a.parquet", "thesis.tex")
    assert "below the file thesis.tex" in refused(command, "a.parquet", "thesis.tex/out", capsys)


@pytest.mark.parametrize(
    ("command", "mark"), [("audit", "audit.json"), ("ingest", "manifest.json")]
)
def test_an_old_output_that_may_not_be_replaced(command, mark, place, capsys, monkeypatch):
    lay(place, "a.parquet", f"old/{mark}")
    locked = place / "old"

    def may(path, mode, **_):
        return Path(path).resolve() != locked or not mode & os.W_OK

    monkeypatch.setattr(os, "access", may)
    assert "old, where you may not write" in refused(command, "a.parquet", "old", capsys)


@pytest.mark.parametrize("name", ["a.parquet", "a.PARQUET", "a.pq"])
@pytest.mark.parametrize("command", COMMANDS)
def test_no_room(command, name, place, capsys, monkeypatch):
    lay(place / "recordings", name, data=PARQUET)
    free = len(PARQUET) - 1
    monkeypatch.setattr(shutil, "disk_usage", lambda _: shutil._ntuple_diskusage(1, 1, free))
    assert "MiB free" in refused(command, "recordings", "out", capsys)


@pytest.mark.parametrize("command", COMMANDS)
def test_no_permission_to_write(command, place, capsys, monkeypatch):
    lay(place / "recordings", "a.parquet")
    monkeypatch.setattr(os, "access", lambda _, mode, **__: not mode & os.W_OK)
    assert "where you may not write" in refused(command, "recordings", "new/out", capsys)


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("locked", ["locked", "locked/recordings", "locked/recordings/sub"])
def test_no_permission_to_read(locked, command, place, capsys, monkeypatch):
    """An unreadable folder above, at and below the recordings; the root may read any, so faked."""
    lay(place / "locked" / "recordings", "a.parquet", "sub/b.parquet")
    top = place / locked

    def guarded(call, inside_only):
        def ask(path=".", *args, **options):
            if not isinstance(path, int):
                asked = Path(os.path.abspath(os.fsdecode(path)))
                if top in asked.parents or (not inside_only and asked == top):
                    raise PermissionError(13, "Permission denied", str(path))
            return call(path, *args, **options)

        return ask

    with monkeypatch.context() as patched:
        patched.setattr(os, "stat", guarded(os.stat, True))
        patched.setattr(os, "scandir", guarded(os.scandir, False))
        capsys.readouterr()
        code = main([command, "locked/recordings", "--out", "out"])
    printed = capsys.readouterr()
    assert code == 2 and "not readable (Permission denied)" in printed.err
    assert "fault of genpolicy" not in printed.err and len(printed.err.splitlines()) == 1
    assert not (place / "out").exists()


@pytest.mark.parametrize("command", COMMANDS)
def test_an_array_that_may_not_be_listed(command, place, capsys, monkeypatch):
    """Left out in silence, the rest of the buffer would be audited as the whole."""
    lay(place / "b.zarr", ".zgroup", "meta/episode_ends/.zarray", "data/a/.zarray")
    scan = os.scandir

    def guarded(path="."):
        if not isinstance(path, int) and os.fsdecode(path).endswith("data/a"):
            raise PermissionError(13, "Permission denied", str(path))
        return scan(path)

    with monkeypatch.context() as patched:
        patched.setattr(os, "scandir", guarded)
        code = main([command, "b.zarr", "--out", "out"])
    assert code == 2 and "not readable (Permission denied)" in capsys.readouterr().err


def test_whole_files_and_a_stated_layout_pass(place):
    for name, data in WHOLE.items():
        lay(place, name, data=data)
        check_ends(place / name, detect.detect(place / name))
    block = HDF5[:-8]
    lay(place, "user.hdf5", data=bytes(512) + block + bytes(96 - len(block)))
    check_ends(place / "user.hdf5", "robomimic")
    lay(place, "new.hdf5", data=detect.HDF5_MAGIC + b"\x03\x08\x08\0" + bytes(16)
        + (48).to_bytes(8, "little") + bytes(12))  # fmt: skip
    check_ends(place / "new.hdf5", "robomimic")
    with pytest.raises(IntegrityError, match="superblock version 9"):
        lay(place, "later.hdf5", data=detect.HDF5_MAGIC + b"\x09" + bytes(60))
        check_ends(place / "later.hdf5", "robomimic")


def test_names_of_the_dataset_are_those_of_its_writer():
    assert (detect.MANIFEST_FILE, detect.FRAMES_FILE) == (
        assemble.MANIFEST_FILE, assemble.FRAMES_FILE,
    )  # fmt: skip


def test_names_of_an_audit_are_those_of_its_writer():
    written = (command.DOCUMENT, command.PAGE, f"{detect.DATASET}/{assemble.MANIFEST_FILE}")
    assert written == detect.AUDIT_FILES


def test_help_and_a_wrong_path_load_nothing_heavy(metadata, tmp_path):
    words = [["--help"], ["audit", "--help"], ["ingest", "--help"], ["propose", "--help"],
             *([name, "absent", "--out", "out"] for name in COMMANDS)]  # fmt: skip
    program = f"""
import sys
sys.path.insert(0, {str(metadata)!r})
from genpolicy.cli.main import main
codes = [main(words) for words in {words!r}]
print(codes, [name for name in {HEAVY!r} if name in sys.modules])
"""
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True,
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}, cwd=tmp_path,
    )  # fmt: skip
    assert done.stdout.splitlines()[-1] == "[0, 0, 0, 0, 2, 2, 2] []"
