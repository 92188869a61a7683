"""Strict JSON and YAML: one reading of every document, or none."""

import random
from collections import Counter
from pathlib import Path

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from genpolicy.errors import BadInputError, ConfigError, ContractError
from genpolicy.integrity import documents
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
        b"[" * 200_000, b"- " * 200_000, b"a: >#\n  b", b"a: [b\t: ]", b"a\tb: 1",
        b"a: 1\n---\nb: 2", b"? [1]\n: 2", b"a: *missing", b"a: 2020-13-45", b"a: " + b"1" * 5000,
    ],
)  # fmt: skip
def test_yaml_that_is_refused(data):
    with pytest.raises(ConfigError, match=r"^bad\.yaml"):
        parse_yaml(data, where="bad.yaml")


@pytest.mark.parametrize("loader", [documents._QuickLoader, documents._StrictLoader])
def test_aliases_are_counted_however_they_are_read(loader):
    """Inside of one another too, and one that holds itself ends."""
    most = documents.MAXIMUM_ALIASES
    text = "a: &a [x]\nb: [{}]\nc: &c\n  d: *c\n"
    assert (
        len(loader(text.format(", ".join(["*a"] * (most - 1)))).get_single_data()["b"]) == most - 1
    )
    with pytest.raises(yaml.YAMLError, match=f"more than {most} aliases"):
        loader(text.format(", ".join(["*a"] * most))).get_single_data()


def test_both_parsers_say_the_same_of_whatever_is_read_by_the_quick_one():
    """Pieces of our own documents, spoiled at random; a text that one refuses is refused."""
    lines = (Path(__file__).parents[2] / "params.yaml").read_text().splitlines()
    rng = random.Random(0)
    signs = "[]{}:,-&*|>'\"%@`# \\\n~=<é\u2028\x85\x07😀ab01._"
    kinds = Counter()
    for _ in range(800):
        first = rng.randrange(len(lines) - 6)
        text = "\n".join(lines[first : first + rng.randrange(1, 6)])
        for _ in range(rng.randrange(3)):
            place = rng.randrange(len(text) + 1)
            text = text[:place] + rng.choice(["", rng.choice(signs)]) + text[place + 1 :]
        found = [_read(documents._parsed, text), _read(_in_python, text)]
        assert found[0] == found[1], text
        kinds[found[0].startswith("refused")] += 1
        quick = _read(lambda t: documents._QuickLoader(t).get_single_data(), text)
        kinds["quick"] += quick == found[0]
    assert min(kinds.values()) > 100, kinds
    assert kinds["quick"] > 500


def _in_python(text):
    return documents._StrictLoader(text).get_single_data()


def _read(parse, text):
    try:
        return repr(parse(text))
    except (ValueError, TypeError, yaml.YAMLError) as error:
        return f"refused: {error}"


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
