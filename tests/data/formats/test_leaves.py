"""A JSON object is what its parts say; any other text is itself."""

import json
from datetime import date

import numpy as np
import pytest

from genpolicy.data.formats.leaves import (
    MAXIMUM_LEAVES,
    MAXIMUM_TEXT,
    SPANS,
    WIDEST,
    cut,
    holds_several,
    leaves,
    text_of,
    vector_of,
)


def test_an_object_is_its_scalar_parts():
    text = json.dumps({
        "lang": "open it", "layout_id": 3, "done": True, "objects": [{"name": "a"}], "none": None,
        "scene": {"style": 1.5, "deep": {"er": "x", "and": {"deeper": 1}}}, "long": "x" * 300,
    })  # fmt: skip
    assert leaves("ep_meta", text) == {
        "ep_meta.lang": "open it", "ep_meta.layout_id": "3", "ep_meta.done": "True",
        "ep_meta.objects": '[{"name": "a"}]',
        "ep_meta.scene.style": "1.5", "ep_meta.scene.deep.er": "x",
        "ep_meta.scene.deep.and": '{"deeper": 1}', "ep_meta.long": "x" * MAXIMUM_TEXT,
    }  # fmt: skip


def test_a_list_is_a_part_and_the_text_is_not_told_beside_its_parts():
    assert leaves("goal", '{"side": [1, 0], "of": {"n": 2}}') == {
        "goal.side": "[1, 0]", "goal.of.n": "2",
    }  # fmt: skip


@pytest.mark.parametrize("text", ["", "go left", "[1, 2]", "{go left}", "3", '"{}"', "{" * 5000])
def test_any_other_text_is_itself(text):
    assert leaves("said", text) == {"said": text[:MAXIMUM_TEXT]}


def test_nesting_that_no_reader_follows_is_text():
    text = '{"a":' * 100_000 + "1" + "}" * 100_000
    assert leaves("said", text) == {"said": text[:MAXIMUM_TEXT]}


def test_many_parts_are_cut_by_name():
    text = json.dumps({f"k{k:03d}": k for k in reversed(range(300))})
    names = [f"a.k{k:03d}" for k in range(MAXIMUM_LEAVES)]
    assert list(leaves("a", text)) == names


@pytest.mark.parametrize(
    ("text", "said"),
    [('["left"]', "left"), ('["left", "fast"]', "left, fast"), ("[3]", "3"),
     ("[1, [2]]", "[1, [2]]"), ("[true, 2.5]", "[true, 2.5]")],
)  # fmt: skip
def test_a_list_is_what_it_holds(text, said):
    assert leaves("tags", text) == {"tags": said}
    assert leaves("a", f'{{"tags": {text}}}') == {"a.tags": said}


@pytest.mark.parametrize("text", ["[]", "{}", '{"a": null, "b": []}'])
def test_what_is_empty_is_nothing(text):
    assert leaves("tags", text) == {}


@pytest.mark.parametrize(
    ("value", "told"),
    [([{"start_frame": 0, "end_frame": 137, "skill": "pick"}], True),
     ([{"text": "go", "from": 0}], True), ({"deep": [[{"t": {"x": [{"rows": 3}]}}]]}, True),
     ([{"name": "a", "size": 3}], False), ([{"from": "left"}], False),
     ([{"start": [0, 1]}], False)],
)  # fmt: skip
def test_a_list_of_parts_of_the_episode_is_told(value, told):
    found = leaves("a", json.dumps({"b": value}))
    assert (SPANS in found.values()) == told
    assert all(leaves(name, text) == {name: text} for name, text in found.items() if told)


def test_long_lists_of_numbers_stay_whole_and_other_long_lists_differ_where_they_did():
    numbers = json.dumps([0.125] * WIDEST)
    assert leaves("e", numbers) == {"e": numbers}
    assert vector_of(numbers) == (0.125,) * WIDEST
    texts = [leaves("t", json.dumps(["left"] * 99 + [end]))["t"] for end in "ab"]
    assert texts[0] != texts[1] and max(map(len, texts)) <= MAXIMUM_TEXT
    assert leaves("e", json.dumps([0.5] * (WIDEST + 1)))["e"] == cut(json.dumps([0.5] * 1025))


@pytest.mark.parametrize("text", ["3", "go [1]", "[1]", '["a", "b"]', "[1, null]", "[", '{"a": 1}'])
def test_what_is_no_list_of_numbers_is_no_vector(text):
    assert vector_of(text) is None


@pytest.mark.parametrize(
    ("value", "text"),
    [("go", "go"), (b"go", "go"), (True, "True"), (1.5, "1.5"), (np.float32(0.5), "0.5"),
     (np.array([1, 2]), "[1, 2]"), (np.array([b"a", b"b"]), '["a", "b"]'),
     ({"a": [1]}, '{"a": [1]}'), (date(2026, 5, 1), "2026-05-01"), ([], None), (None, None),
     (object(), None)],
)  # fmt: skip
def test_values_of_any_kind_as_text(value, text):
    assert text_of(value) == text


def test_lists_of_several():
    assert [holds_several(text) for text in ('["a"]', '["a", "b"]', "a, b")] == [False, True, False]
