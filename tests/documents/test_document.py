"""A document says by name what is wrong with it, and comes back as it was written."""

from dataclasses import dataclass

import pytest

from genpolicy.documents.document import SAID, Count, Document
from genpolicy.errors import BadInputError, ContractError, IntegrityError


@dataclass(frozen=True)
class Part:
    label: str
    share: float | None


@dataclass(frozen=True)
class Whole:
    parts: list[Part]
    by_name: dict[str, Part]
    corner: tuple[float, float]
    count: Count
    sure: bool


OF = Document("whole.json", Whole)
GOOD = {
    "parts": [{"label": "a", "share": None}], "by_name": {"b": {"label": "b", "share": 0.5}},
    "corner": [0.0, 1.5], "count": 3, "sure": True,
}  # fmt: skip


def test_what_was_written_comes_back(tmp_path):
    content = OF.parse(GOOD, where="w")
    assert content.parts == [Part("a", None)] and content.corner == (0.0, 1.5)
    assert OF.plain(content) == GOOD
    OF.write(tmp_path, content)
    assert OF.read(tmp_path) == content
    assert (tmp_path / "whole.json").read_bytes().startswith(b'{\n  "by_name": {')


@pytest.mark.parametrize(("changes", "said"), [
    ({"odd": 1}, "the unknown key odd"),
    ({"parts": [{"label": "a", "share": None, "odd": 1}]}, "the unknown key parts.0.odd"),
    ({"by_name": {"b": {"label": "b"}}}, "the missing key by_name.b.share"),
    ({"count": -1}, "count = -1 (Input should be greater than or equal to 0)"),
    ({"count": True}, "count = True (Input should be a valid integer)"),
    ({"count": "3"}, "count = '3' (Input should be a valid integer)"),
    ({"count": 3.0}, "count = 3.0 (Input should be a valid integer)"),
    ({"sure": 1}, "sure = 1 (Input should be a valid boolean)"),
    ({"corner": [0.0]}, "the missing key corner.1"),
    ({"parts": None}, "parts = None (Input should be a valid array)"),
    ({"parts": [{"label": "a", "share": 10**400}]}, "(Input should be a finite number)"),
])  # fmt: skip
def test_what_is_wrong_is_said_by_name(changes, said):
    with pytest.raises(IntegrityError) as caught:
        OF.parse({**GOOD, **changes}, where="w/whole.json")
    assert said in caught.value.found and caught.value.where == "w/whole.json"


def test_a_misspelt_key_is_said_before_others_and_many_misfits_are_counted():
    document = {**GOOD, "surex": True, "parts": [{}, {}, {}]}
    del document["sure"]
    with pytest.raises(IntegrityError, match="with the unknown key surex, ") as caught:
        OF.parse(document, where="w")
    assert caught.value.found.endswith(f"{2 * 3 + 2 - SAID} more misfits")


@pytest.mark.parametrize("value", [[], None, 3, "text", "\ud800", [GOOD]])
def test_a_document_of_another_form_is_refused(value):
    with pytest.raises(IntegrityError, match="with"):
        OF.parse(value, where="w")


def test_a_value_that_could_not_be_read_back_is_not_written(tmp_path):
    with pytest.raises(ValueError, match="Expected `int`"):
        OF.write(tmp_path, Whole([], {}, (0.0, 0.0), 0.5, False))
    assert list(tmp_path.iterdir()) == []


def test_no_number_that_is_none_is_written_and_no_file_is_bad_input(tmp_path):
    with pytest.raises(ContractError):
        OF.write(tmp_path, Whole([Part("a", float("nan"))], {}, (0.0, 0.0), 0, False))
    with pytest.raises(BadInputError, match=r"whole\.json is not readable"):
        OF.read(tmp_path)
