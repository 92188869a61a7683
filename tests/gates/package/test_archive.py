"""The archive: whole or nothing, and nothing is believed that is read from it."""

import io
import os
import re
import shutil
import zipfile
from types import SimpleNamespace

import pytest

from gates.package import archive
from gates.package.archive import INDEX_NAME, blob_name, read_index, unpack, write_archive
from gates.package.index import BundledFile, BundledGroup, BundleIndex
from genpolicy.errors import BadInputError, IntegrityError
from genpolicy.integrity.hashing import sha256_bytes

FILES = {"a/b.txt": b"one", "c": b"two", "d/e/f": b"one", "g": b"six"}
STATEMENT = b'{"a":1}'


@pytest.fixture
def root(tmp_path):
    for name, data in FILES.items():
        (tmp_path / "run" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "run" / name).write_bytes(data)
    return tmp_path / "run"


@pytest.fixture
def index():
    files = {n: BundledFile(sha256=sha256_bytes(d), size=len(d)) for n, d in FILES.items()}
    return BundleIndex(
        schema_version=1,
        candidate="flow",
        checkpoint="a" * 64,
        commit="",
        verdicts={"A": "PASS"},
        groups=[BundledGroup(number=1, title="t", files=["c"])],
        files=files,
        statements={"A": sha256_bytes(STATEMENT)},
        limits=[],
    )


@pytest.fixture
def written(tmp_path, root, index):
    write_archive(tmp_path / "x.zip", index, {"statements/gate_a.json": STATEMENT}, root=root)
    return tmp_path / "x.zip"


def again(path, change):
    """The archive with other entries; `change` gets them by name."""
    with zipfile.ZipFile(path) as whole:
        entries = {name: whole.read(name) for name in whole.namelist()}
    change(entries)
    with zipfile.ZipFile(path, "w") as other:
        for name, data in entries.items():
            other.writestr(name, data)


def out(tmp_path):
    (tmp_path / "out").mkdir()
    return tmp_path / "out"


def test_programs_can_be_run_where_they_are_unpacked(tmp_path, root, index):
    files = {**index.files, "c": index.files["c"].model_copy(update={"executable": True})}
    marked = index.model_copy(update={"files": files})
    write_archive(tmp_path / "x.zip", marked, {"statements/gate_a.json": STATEMENT}, root=root)
    folder = out(tmp_path)
    unpack(tmp_path / "x.zip", folder)
    modes = {name: (folder / name).stat().st_mode & 0o777 for name in ("c", "a/b.txt")}
    assert modes == {"c": 0o755, "a/b.txt": 0o644}


@pytest.mark.parametrize("kind", [zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_an_entry_packed_in_another_way_is_refused(tmp_path, written, kind):
    with zipfile.ZipFile(written, "a") as whole:
        whole.writestr("more", b"x", kind)
    with pytest.raises(IntegrityError, match="packed in another way"):
        unpack(written, out(tmp_path))


def test_an_entry_may_be_deflated_or_not(tmp_path, written, index):
    name = blob_name(sha256_bytes(b"two"))
    again(written, lambda entries: entries.pop(name))
    with zipfile.ZipFile(written, "a") as whole:
        whole.writestr(name, b"two", zipfile.ZIP_DEFLATED)
        assert len({entry.compress_type for entry in whole.infolist()}) == 2
    assert unpack(written, out(tmp_path))[0] == index


@pytest.mark.parametrize("place", ["", "run"])
def test_a_folder_is_no_place_for_an_archive(tmp_path, root, index, place):
    with pytest.raises(BadInputError, match="is a folder"):
        write_archive(tmp_path / place, index, {}, root=root)


def test_what_is_unpacked_is_what_lay_there(tmp_path, written, index):
    folder = out(tmp_path)
    found, statements = unpack(written, folder)
    assert found == index == read_index(written)
    assert statements == {"A": STATEMENT}
    files = {p.relative_to(folder).as_posix(): p for p in folder.rglob("*") if p.is_file()}
    assert {name: path.read_bytes() for name, path in files.items()} == FILES


def test_equal_bytes_are_carried_once_and_the_same_run_gives_the_same_archive(
    tmp_path, written, root, index
):
    with zipfile.ZipFile(written) as whole:
        assert sum(name.startswith("blobs/") for name in whole.namelist()) == 3
    os.utime(root / "c", (1, 1))
    write_archive(tmp_path / "y.zip", index, {"statements/gate_a.json": STATEMENT}, root=root)
    assert (tmp_path / "y.zip").read_bytes() == written.read_bytes()


def test_a_file_that_changes_meanwhile_leaves_nothing_new(tmp_path, written, root, index):
    before = written.read_bytes()
    (root / "c").write_bytes(b"2")
    with pytest.raises(IntegrityError, match="changed while it was packaged"):
        write_archive(written, index, {}, root=root)
    assert written.read_bytes() == before
    assert sorted(p.name for p in tmp_path.iterdir()) == ["run", "x.zip"]


def test_a_place_that_cannot_be_written_is_told(tmp_path, root, index):
    (tmp_path / "file").write_text("")
    with pytest.raises(BadInputError, match=r"is not writable \(File exists\), expected"):
        write_archive(tmp_path / "file" / "x.zip", index, {}, root=root)


def test_every_changed_byte_of_a_file_is_seen(tmp_path, written):
    name = blob_name(sha256_bytes(b"two"))
    again(written, lambda entries: entries.update({name: b"twO"}))
    said = f"c is other bytes than its index says, expected 3 bytes, {sha256_bytes(b'two')[:12]}…"
    with pytest.raises(IntegrityError, match=re.escape(said)):
        unpack(written, out(tmp_path))


def test_no_more_is_unpacked_than_the_index_says(tmp_path, written, monkeypatch):
    name = blob_name(sha256_bytes(b"two"))
    again(written, lambda entries: entries.update({name: b"two" * 1000}))
    monkeypatch.setattr(archive, "CHUNK_BYTES", 2)
    folder = out(tmp_path)
    with pytest.raises(IntegrityError, match="other bytes than its index says"):
        unpack(written, folder)
    assert (folder / "c").stat().st_size <= 3


def test_an_entry_without_an_end_is_left_at_the_first_byte_too_many(index):
    """However much it would unpack to: no more is read once more came than the index says."""
    reads = []

    class Endless(io.RawIOBase):
        def read(self, size=-1):
            reads.append(size)
            assert len(reads) < 9, "read on"
            return b"twotwo"

    endless = SimpleNamespace(open=lambda name: Endless())
    with pytest.raises(IntegrityError, match="other bytes than its index says"):
        archive._copy(endless, index.files["c"], io.BytesIO(), "c")
    assert len(reads) == 1


def test_another_statement_is_seen(tmp_path, written):
    again(written, lambda entries: entries.update({"statements/gate_a.json": b"{}"}))
    with pytest.raises(IntegrityError, match=r"gate_a\.json is other bytes"):
        unpack(written, out(tmp_path))


@pytest.mark.parametrize("name", ["blobs/more", "../outside", "index.json.bak"])
def test_an_entry_that_the_index_does_not_name_is_refused(tmp_path, written, name):
    again(written, lambda entries: entries.update({name: b"x"}))
    with pytest.raises(IntegrityError, match="without or beyond"):
        unpack(written, out(tmp_path))
    assert not (tmp_path / "outside").exists()


def test_of_several_entries_the_first_by_name_is_told(tmp_path, written):
    again(written, lambda entries: entries.update({"blobs/z": b"", "a_more": b""}))
    with pytest.raises(IntegrityError, match="without or beyond 'a_more'"):
        unpack(written, out(tmp_path))


def test_an_archive_without_an_index_is_told(written):
    again(written, lambda entries: entries.pop(INDEX_NAME))
    with pytest.raises(IntegrityError, match=r"without an entry \(.*index\.json.*\)"):
        read_index(written)


def test_a_file_that_lies_there_already_is_told_and_kept(tmp_path, written):
    folder = out(tmp_path)
    (folder / "c").write_text("mine")
    said = f"{folder / 'c'} is not readable or writable (File exists), expected"
    with pytest.raises(BadInputError, match=re.escape(said)):
        unpack(written, folder)
    assert (folder / "c").read_text() == "mine"


def test_a_device_that_fails_is_told_with_the_archive(tmp_path, written, monkeypatch):
    """Such an error names no file, and may have no words of its own."""

    def fails(_):
        raise OSError("the device is gone")

    monkeypatch.setattr(archive.shutil, "disk_usage", fails)
    said = f"{written} is not readable or writable (the device is gone), expected"
    with pytest.raises(BadInputError, match=re.escape(said)):
        unpack(written, out(tmp_path))


def test_a_missing_entry_is_refused(tmp_path, written):
    again(written, lambda entries: entries.pop(blob_name(sha256_bytes(b"two"))))
    with pytest.raises(IntegrityError, match="without or beyond"):
        unpack(written, out(tmp_path))


def test_two_entries_of_one_name_are_refused(tmp_path, written):
    with (
        zipfile.ZipFile(written, "a") as whole,
        pytest.warns(UserWarning, match="Duplicate name"),
    ):
        whole.writestr(INDEX_NAME, whole.read(INDEX_NAME))
    with pytest.raises(IntegrityError, match="two entries of one name"):
        unpack(written, out(tmp_path))


def test_too_large_an_index_is_not_read(written, index, monkeypatch):
    monkeypatch.setattr(archive, "INDEX_BYTES", len(index.data()))
    assert read_index(written) == index
    monkeypatch.setattr(archive, "INDEX_BYTES", len(index.data()) - 1)
    with pytest.raises(IntegrityError, match="too large"):
        read_index(written)


@pytest.mark.parametrize("keep", [0, 10, 0.5, 0.9])
def test_a_cut_archive_is_told(tmp_path, written, keep):
    data = written.read_bytes()
    written.write_bytes(data[: keep if isinstance(keep, int) else int(keep * len(data))])
    with pytest.raises(IntegrityError, match="whole archive"):
        unpack(written, out(tmp_path))


def test_every_flipped_byte_is_seen_or_lies_in_nothing_that_is_used(tmp_path, written, index):
    """Times and flags of the container may differ; no file, statement or index may."""
    data = written.read_bytes()
    for place in range(0, len(data), 7):
        flipped = bytearray(data)
        flipped[place] ^= 0x10
        written.write_bytes(flipped)
        folder = out(tmp_path)
        try:
            found, statements = unpack(written, folder)
        except BadInputError:
            pass
        else:
            assert (found, statements) == (index, {"A": STATEMENT})
            assert all((folder / name).read_bytes() == text for name, text in FILES.items())
        shutil.rmtree(folder)


def test_no_archive_is_told(tmp_path):
    with pytest.raises(BadInputError, match="is no file"):
        read_index(tmp_path / "absent.zip")
    (tmp_path / "text").write_text("no archive")
    with pytest.raises(IntegrityError, match="whole archive"):
        read_index(tmp_path / "text")


def test_a_full_disk_is_told_before_anything_is_unpacked(tmp_path, written, monkeypatch):
    monkeypatch.setattr(archive.shutil, "disk_usage", lambda _: SimpleNamespace(free=5))
    folder = out(tmp_path)
    with pytest.raises(BadInputError, match="MiB free"):
        unpack(written, folder)
    assert not list(folder.iterdir())


def test_room_is_needed_for_the_files_and_a_margin(tmp_path, index, monkeypatch):
    """Four files of 3 MiB: 76 MiB with the margin are enough, a byte less is not."""
    files = {n: f.model_copy(update={"size": 3 << 20}) for n, f in index.files.items()}
    larger = index.model_copy(update={"files": files})
    disk = SimpleNamespace(free=76 << 20)
    monkeypatch.setattr(archive.shutil, "disk_usage", lambda _: disk)
    archive._require_space(larger, tmp_path)
    disk.free -= 1
    with pytest.raises(BadInputError, match="75 MiB free, expected room for the bundle's 12 MiB"):
        archive._require_space(larger, tmp_path)
