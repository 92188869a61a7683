"""Names that hide how they are written, and names that only look like others."""

import unicodedata

import pytest

from gates.card.names import LOOKS_LIKE, OF_ALPHABETS, as_drawn, as_read, disguise

LOOKS_LIKE_RITA_RAY = {
    "zero width": "Rita\u200b Ray",
    "soft hyphen": "Ri\u00adta Ray",
    "Cyrillic": "Rit\u0430 Ray",
    "full width": "\uff32\uff49\uff54\uff41 Ray",
    "decomposed": "R\u00ec\u0301ta Ray".replace("\u00ec", "i"),
    "bidirectional": "\u202eyaR atiR\u202c",
    "a filler": "Rita \u3164Ray",
    "nothing to see": "\u2060",
    "a joiner of graphemes": "Ri\u034fta Ray",
    "a selector": "Rita\ufe00 Ray",
    "a selector of ideographs": "Rita\U000e0100 Ray",
    "a Mongolian selector": "Rita\u180b Ray",
    "a newer Mongolian selector": "Rita\u180f Ray",
    "a vowel that is not written": "Rita\u17b4 Ray",
    "a blank of braille": "Rita\u2800 Ray",
    "a Khitan filler": "Rita\U00016fe4 Ray",
    "phonetic": "Rit\u0251 Ray",
    "small capital": "R\u026ata Ray",
    "Lisu": "Rit\ua4ee Ray",
    "Canadian": "\u1587ita Ray",
    "Coptic": "Rita \u2ca3ay",
    "Deseret": "Rita \U00010420ay",
    "Armenian, a whole word": "\u0585\u057d Ray",
    "Cyrillic, a whole word": "Rita \u0425\u0430\u0443",
    "marks of another script": "Rita\u064e Ray",
}
LOOKS_LIKE_ADA_LI = {
    "Cyrillic and Cherokee": "\u0410\u0501\u0430 \u13de\u13a5",
    "Lisu": "\ua4ee\ua4d3\ua4ee \ua4e1\ua4f2",
    "Turkish": "Ada L\u0131",
    "a stop behind it": "Ada Li.",
    "a line between": "Ada-Li",
    "a turned comma": "Ada\u02bb Li",
    "no space": "AdaLi",
    "a space more": "A da Li",
}
"""Each may be the name of somebody, and none on a list that has an Ada Li."""


@pytest.mark.parametrize("how", LOOKS_LIKE_RITA_RAY)
def test_a_name_in_disguise_is_told(how):
    assert disguise(LOOKS_LIKE_RITA_RAY[how])


@pytest.mark.parametrize("name", [
    "Rita Ray", "Ümit Özdağ", "佐藤 花子", "Мария Иванова", "O'Neil-Smith", "Мария Smith", "R. 2",
    "Işıl Yıldız", "Νίκος Παπαδόπουλος", "Роса Соха", "Gūnther Æsir", "田中さくら", "サトウ 花子",
    "김철수", "Իլյա Սարոյան", "יעל כהן", "ليلى حداد", "प्रिया शर्मा", "Nguyễn Thị Hương", "Kaʻiulani",
])  # fmt: skip
def test_a_name_that_is_written_as_it_looks_is_one(name):
    assert disguise(name) == ""


def test_a_hurried_reader_sees_neither_case_nor_spaces():
    assert as_read("  Rita   RAY") == as_read("rita ray") != as_read("rita roy")
    assert as_read("RitaRay") == as_read("Rita Ray") and as_drawn("RitaRay") == as_drawn("Rita Ray")
    assert as_read("Vvanda") == as_read("WANDA") == as_read("vVanda")


@pytest.mark.parametrize("how", LOOKS_LIKE_ADA_LI)
def test_what_looks_like_another_name_reads_like_it(how):
    assert disguise(LOOKS_LIKE_ADA_LI[how]) == ""
    assert as_read(LOOKS_LIKE_ADA_LI[how]) == as_read("Ada Li")


@pytest.mark.parametrize("one, other", [
    ("Al Ray", "AI Ray"), ("Ilya Ray", "llya Ray"), ("Kam", "Karn"), ("R. 10", "R. lO"),
    ("Rita\u2010Ray", "Rita-Ray"), ("VVanda", "Wanda"), ("Evva", "Ewa"), ("AIRay", "Al Ray"),
])  # fmt: skip
def test_strokes_that_are_the_same_are_drawn_alike(one, other):
    assert as_drawn(one) == as_drawn(other)


@pytest.mark.parametrize("one, other", [
    ("Rita Ray", "Rita Roy"), ("Мария", "Марина"), ("Ana", "Aña"), ("Eli Ray", "Ell Ray"),
    ("佐藤 花子", "佐藤 桃子"), ("Ada Li", "Ida Li"), ("Eva", "Ewa"), ("Wanda", "Vanda"),
    ("Omar Nash", "Omamash"), ("Lev Vance", "LeWance"), ("Rita Ray", "Ray Rita"),
])  # fmt: skip
def test_names_that_differ_to_the_eye_stay_two(one, other):
    assert as_read(one) != as_read(other) and as_drawn(one) != as_drawn(other)


def test_each_letter_looks_like_one_other_and_stays_itself_in_its_usual_form():
    letters = "".join(LOOKS_LIKE.values())
    assert len(set(letters)) == len(letters) > 200
    assert not set(letters) & set("".join(LOOKS_LIKE)) and set(OF_ALPHABETS) <= set(letters)
    assert unicodedata.normalize("NFKC", letters) == letters
    assert all(unicodedata.category(letter)[0] == "L" for letter in letters)
