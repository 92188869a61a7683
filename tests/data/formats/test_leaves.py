"""A JSON object is what its parts say; any other text is itself."""

import json

import pytest

from genpolicy.data.formats.leaves import MAXIMUM_LEAVES, MAXIMUM_TEXT, leaves


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
