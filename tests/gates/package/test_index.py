"""Indexes: one form, paths that stay below, an address that names every byte."""

import json
import re

import pytest

from gates.package.index import BundledFile, BundledGroup, BundleIndex, parse_index
from genpolicy.errors import IntegrityError
from genpolicy.integrity.documents import canonical_json

SHA = "a" * 64


def index_of(*names, **changes):
    files = {name: BundledFile(sha256=SHA, size=1) for name in names or ("a/b",)}
    values = {
        "schema_version": 1,
        "candidate": "flow",
        "checkpoint": SHA,
        "commit": "",
        "verdicts": {"A": "PASS"},
        "groups": [BundledGroup(number=1, title="t", files=list(files)[:1])],
        "files": files,
        "statements": {"A": SHA},
        "limits": [],
    }
    return BundleIndex(**{**values, **changes})


def test_an_index_reads_back_as_it_was_written():
    index = index_of("a/b", "c")
    assert parse_index(index.data(), where="x") == index
    assert parse_index(index.data(), where="x").address == index.address


def test_the_address_is_of_every_byte_that_it_names():
    plain = index_of("a/b", "c")
    other = index_of("a/b", "c", files={**plain.files, "c": BundledFile(sha256="b" * 64, size=1)})
    named = index_of("a/b", "c", verdicts={"A": "FAIL"})
    assert len({plain.address, other.address, named.address}) == 3


@pytest.mark.parametrize(
    "name",
    ["../x", "/etc/passwd", "a/../b", "a//b", "./a", "a\\b", "a\x00b", "a\nb", "", ".", "a/"],
)
def test_a_path_that_leads_out_or_has_two_spellings_is_refused(name):
    document = json.loads(index_of("a/b").data())
    document["files"] = {name: {"sha256": SHA, "size": 1}}
    document["groups"][0]["files"] = [name]
    with pytest.raises(IntegrityError, match="no path below"):
        parse_index(canonical_json(document), where="x")


def test_a_file_that_is_a_folder_too_is_refused():
    document = json.loads(index_of("a/b").data())
    document["files"]["a"] = {"sha256": SHA, "size": 1}
    with pytest.raises(IntegrityError, match="a file and a folder"):
        parse_index(canonical_json(document), where="x")


def test_a_group_of_files_that_are_not_there_is_refused():
    document = json.loads(index_of("a/b").data())
    document["groups"][0]["files"] = ["a/c"]
    with pytest.raises(IntegrityError, match="none of the files"):
        parse_index(canonical_json(document), where="x")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"more": 1}, "more: "),
        ({"schema_version": 2, "more": 1}, "schema_version: "),
        ({"groups": [{"number": 1, "title": "t", "files": []}]}, "groups.0.files: "),
        (
            {"files": {"/x": {"sha256": SHA, "size": 1}}},
            "document: Value error, files: '/x' is no ",
        ),
    ],
)
def test_what_is_wrong_is_told_by_its_place_and_the_first_of_several(change, said):
    document = {**json.loads(index_of("a/b").data()), **change}
    with pytest.raises(IntegrityError, match=re.escape(f"not an index ({said}")):
        parse_index(canonical_json(document), where="x")


def test_an_empty_file_is_a_file():
    empty = {"a/b": BundledFile(sha256=SHA, size=0)}
    assert parse_index(index_of(files=empty).data(), where="x").files == empty


@pytest.mark.parametrize(
    "change",
    [
        {"schema_version": 2},
        {"checkpoint": "A" * 64},
        {"files": {"a": {"sha256": SHA, "size": -1}}},
        {"verdicts": {"F": "PASS"}},
        {"commit": "the best one"},
        {"more": 1},
    ],
)
def test_another_form_is_refused(change):
    document = {**json.loads(index_of("a/b").data()), **change}
    with pytest.raises(IntegrityError, match="not an index"):
        parse_index(canonical_json(document), where="x")


def test_the_same_content_in_another_writing_is_refused():
    spaced = json.dumps(json.loads(index_of().data()), indent=1).encode()
    with pytest.raises(IntegrityError, match="another form than it is written in"):
        parse_index(spaced, where="x")
