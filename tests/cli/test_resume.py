"""An interrupted audit goes on only from the same recordings, contract and version."""

import os
from types import SimpleNamespace

import pytest

from genpolicy.cli import resume
from genpolicy.cli.resume import DATASET, KEY, fingerprint, kept_or_new, work_folder


@pytest.fixture
def recordings(tmp_path):
    folder = tmp_path / "recordings"
    folder.mkdir()
    for name in ("a", "b"):
        (folder / name).write_bytes(b"12345678")
        os.utime(folder / name, ns=(10**18, 10**18))
    return folder


def key(path, **changes):
    return fingerprint(path, **{"format": "auto", "contract": None, "task": None, **changes})


def test_the_key_is_the_same_for_the_same_recordings(recordings):
    assert key(recordings) == key(recordings)
    assert key(recordings / "a") == key(recordings / "a") != key(recordings)


@pytest.mark.parametrize("change", ["size", "time", "name", "one less", "elsewhere"])
def test_the_key_changes_with_whatever_was_recorded(recordings, change, tmp_path):
    before, one = key(recordings), recordings / "a"
    if change == "size":
        one.write_bytes(b"123456789")
        os.utime(one, ns=(10**18, 10**18))
    elif change == "time":
        os.utime(one, ns=(10**18, 10**18 + 1))
    elif change == "name":
        one.rename(recordings / "c")
    elif change == "one less":
        one.unlink()
    else:
        recordings = recordings.rename(tmp_path / "moved")
    assert key(recordings) != before


def test_the_key_changes_with_the_way_of_reading(recordings, monkeypatch):
    keys = {key(recordings), key(recordings, format="zarr"), key(recordings, task="push")}
    monkeypatch.setattr(resume, "version", lambda name: "another")
    assert len(keys | {key(recordings)}) == 4


@pytest.fixture
def imports(monkeypatch):
    """Imports that only note how often they were made; a kept dataset opens if it is there."""
    made = []

    def make(folder):
        folder.mkdir(parents=True)
        made.append(folder)
        return SimpleNamespace(folder=folder)

    def opened(folder, *, out):
        if not folder.is_dir():
            raise resume.BadInputError(
                where=str(folder), found="nothing", expected="a dataset", action="Import again."
            )
        return SimpleNamespace(folder=folder)

    monkeypatch.setattr(resume, "open_dataset", opened)
    return SimpleNamespace(made=made, make=make)


def test_the_same_key_goes_on_and_another_begins_anew(imports, tmp_path):
    work = work_folder(tmp_path / "audit")
    assert work == tmp_path / ".audit.work"
    for wanted, count in (("k1", 1), ("k1", 1), ("k2", 2), ("k1", 3)):
        (work / "left over").parent.mkdir(exist_ok=True)
        assert kept_or_new(work, wanted, imports.make).folder == work / DATASET
        assert len(imports.made) == count


@pytest.mark.parametrize("damage", ["key", "dataset", "no key"])
def test_what_is_damaged_is_imported_again(imports, tmp_path, damage):
    work = tmp_path / "work"
    kept_or_new(work, "k", imports.make)
    if damage == "key":
        (work / KEY).write_text("{")
    elif damage == "no key":
        (work / KEY).unlink()
    else:
        (work / DATASET).rmdir()
    kept_or_new(work, "k", imports.make)
    assert len(imports.made) == 2


def test_recordings_that_already_are_a_dataset_are_not_kept(imports, tmp_path):
    there = SimpleNamespace(folder=tmp_path / "elsewhere")
    assert kept_or_new(tmp_path / "work", "k", lambda folder: there) is there
    assert not (tmp_path / "work" / KEY).exists()
