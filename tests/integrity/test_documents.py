"""Strict JSON and YAML: one reading of every document, or none."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from genpolicy.errors import BadInputError, ConfigError, ContractError
from genpolicy.integrity.documents import (
    canonical_json,
    parse_json,
    parse_yaml,
    read_json,
    read_yaml,
)

VALUES = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(st.characters(exclude_categories=["Cs"])),
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.dictionaries(st.text(st.characters(exclude_categories=["Cs"])), inner, max_size=4)
    ),
    max_leaves=12,
)


@settings(max_examples=100, deadline=None)
@given(VALUES)
def test_canonical_json_round_trips(value):
    data = canonical_json(value)
    assert parse_json(data, where="x") == value
    assert canonical_json(parse_json(data, where="x")) == data


def test_canonical_json_golden():
    assert (
        canonical_json({"b": 1.5, "a": ["ä"]})
        == '{\n  "a": [\n    "ä"\n  ],\n  "b": 1.5\n}\n'.encode()
    )
    with pytest.raises(ContractError, match="never NaN"):
        canonical_json({"a": float("nan")})
    with pytest.raises(ContractError, match="plain text"):
        canonical_json({"a": "\ud800"})


@pytest.mark.parametrize(
    "data",
    [
        b"", b"{", b"nope", b'{"a": 1, "a": 2}', b"[NaN]", b"[Infinity]", b"[-Infinity]",
        b"[1e999]", b"\xff\xfe{\x00}\x00", b"\xef\xbb\xbf{}", b"[" * 200_000, b"{} {}", b"1" * 5000,
    ],
)  # fmt: skip
def test_json_that_is_refused(data):
    with pytest.raises(BadInputError, match=r"^bad\.json"):
        parse_json(data, where="bad.json")


BOMB = b"a: &a [x]\n" + b"b: [" + b"*a, " * 40 + b"*a]\n"


@pytest.mark.parametrize(
    "data",
    [
        b"a: 1\na: 2", b"a: !!python/object/apply:os.system [ls]", BOMB, b"a: [", b"\xff\xfe",
        b"a: 1\n---\nb: 2", b"? [1]\n: 2", b"a: *missing", b"a: 2020-13-45", b"a: " + b"1" * 5000,
    ],
)  # fmt: skip
def test_yaml_that_is_refused(data):
    with pytest.raises(ConfigError, match=r"^bad\.yaml"):
        parse_yaml(data, where="bad.yaml")


def test_size_cap(monkeypatch):
    monkeypatch.setattr("genpolicy.integrity.documents.MAXIMUM_DOCUMENT_BYTES", 10)
    for parse in (parse_json, parse_yaml):
        with pytest.raises(BadInputError, match="at most 10 bytes"):
            parse(b"[" + b"1," * 10 + b"1]", where="x")


def test_files(tmp_path):
    (tmp_path / "a.json").write_text('{"a": 1}')
    (tmp_path / "a.yaml").write_text("a: 1")
    assert read_json(tmp_path / "a.json") == read_yaml(tmp_path / "a.yaml") == {"a": 1}
    for read in (read_json, read_yaml):
        with pytest.raises(BadInputError, match=r"absent is not readable"):
            read(tmp_path / "absent")
        with pytest.raises(BadInputError, match="not readable"):
            read(tmp_path)
