"""Hashes of files and folders: known values, no links, no devices, the same bytes parsed."""

import os

import pytest

from genpolicy.errors import IntegrityError
from genpolicy.integrity.hashing import read_verified, sha256_bytes, sha256_file, sha256_tree

# FIPS 180-2, appendix B.1.
ABC = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"


def test_golden(tmp_path):
    (tmp_path / "abc").write_bytes(b"abc")
    assert sha256_bytes(b"abc") == sha256_file(tmp_path / "abc") == ABC
    assert read_verified(tmp_path / "abc", sha256=ABC, named_by="x") == b"abc"


def test_other_bytes_name_who_expected_them(tmp_path):
    (tmp_path / "abc").write_bytes(b"abd")
    with pytest.raises(IntegrityError, match=r"abc is a file with sha256 .* from report\.json"):
        read_verified(tmp_path / "abc", sha256=ABC, named_by="report.json")


def test_what_is_no_regular_file(tmp_path):
    (tmp_path / "file").write_bytes(b"abc")
    (tmp_path / "link").symlink_to("file")
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "folder").mkdir()
    for name in ("link", "pipe", "folder", "absent"):
        with pytest.raises(IntegrityError, match=name):
            sha256_file(tmp_path / name)


def test_tree(tmp_path):
    (tmp_path / "b" / "c").mkdir(parents=True)
    (tmp_path / "b" / "c" / "abc").write_bytes(b"abc")
    (tmp_path / "a").write_bytes(b"")
    assert list(sha256_tree(tmp_path)) == ["a", "b/c/abc"]
    assert sha256_tree(tmp_path)["b/c/abc"] == ABC
    (tmp_path / "link").symlink_to("a")
    with pytest.raises(IntegrityError, match="link"):
        sha256_tree(tmp_path)
    with pytest.raises(IntegrityError, match="missing"):
        sha256_tree(tmp_path / "absent")
