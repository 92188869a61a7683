"""Names that hide how they are written, and names that only look like others."""

import pytest

from gates.card.names import as_read, disguise

LOOKS_LIKE_RITA_RAY = {
    "zero width": "Rita\u200b Ray",
    "soft hyphen": "Ri\u00adta Ray",
    "Cyrillic": "Rit\u0430 Ray",
    "full width": "\uff32\uff49\uff54\uff41 Ray",
    "decomposed": "R\u00ec\u0301ta Ray".replace("\u00ec", "i"),
    "bidirectional": "\u202eyaR atiR\u202c",
    "a filler": "Rita \u3164Ray",
    "nothing to see": "\u2060",
}


@pytest.mark.parametrize("how", LOOKS_LIKE_RITA_RAY)
def test_a_name_in_disguise_is_told(how):
    assert disguise(LOOKS_LIKE_RITA_RAY[how])


@pytest.mark.parametrize("name", [
    "Rita Ray", "Ümit Özdağ", "佐藤 花子", "Мария Иванова", "O'Neil-Smith", "Мария Smith", "R. 2",
])  # fmt: skip
def test_a_name_that_is_written_as_it_looks_is_one(name):
    assert disguise(name) == ""


def test_a_hurried_reader_sees_neither_case_nor_spaces():
    assert as_read("  Rita   RAY") == as_read("rita ray") != as_read("rita roy")
