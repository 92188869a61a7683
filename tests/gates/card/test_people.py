"""Who is independent of whom: identifiers and keys decide, spelling does not."""

import pytest
import yaml
from team import AUTHORS, PEOPLE
from test_names import LOOKS_LIKE_ADA_LI, LOOKS_LIKE_RITA_RAY

from gates.card.people import Person, dependence, load_allow_list, spotting
from genpolicy.errors import ConfigError


def _people(root):
    return yaml.safe_load((root / "reviewers.yaml").read_text())["people"]


def _write(root, people):
    (root / "reviewers.yaml").write_text(yaml.safe_dump({"people": people}, allow_unicode=True))


@pytest.mark.parametrize(
    "spelling",
    [
        "ri\u200bta",  # zero width space
        "ri\u00adta",  # soft hyphen
        "rit\u0430",  # Cyrillic
        "\uff52\uff49\uff54\uff41",  # full width
        "ri\u0301ta",  # decomposed
        "Rita",
        "\u202eatir\u202c",  # bidirectional
        "rita ",
        "",
    ],
)
def test_an_identifier_has_one_spelling(team, spelling):
    people = _people(team.root)
    people[-1]["id"] = spelling
    _write(team.root, people)
    with pytest.raises(ConfigError, match=r"reviewers\.yaml"):
        load_allow_list(team.root)


@pytest.mark.parametrize("how", LOOKS_LIKE_RITA_RAY)
def test_one_person_under_a_name_that_looks_like_another_is_refused(team, how):
    """Five keys of one hand under five such names would read as five people."""
    people = _people(team.root)
    people[0]["name"], people[-1]["name"] = "Rita Ray", LOOKS_LIKE_RITA_RAY[how]
    _write(team.root, people)
    with pytest.raises(ConfigError, match=f"name of {people[-1]['id']}"):
        load_allow_list(team.root)


@pytest.mark.parametrize("name", ["Rita", "rita", " RITA "])
def test_two_names_that_read_alike_are_told_apart_or_refused(team, name):
    people = _people(team.root)
    people[-1]["name"] = name
    _write(team.root, people)
    with pytest.raises(ConfigError, match=r"name is the same value twice"):
        load_allow_list(team.root)
    people[-1]["name"] = f"{name} of the south wing"
    _write(team.root, people)
    assert load_allow_list(team.root).find("ada") is not None


@pytest.mark.parametrize("name", [*LOOKS_LIKE_ADA_LI.values(), "Ada Ll"])
def test_two_real_names_that_look_alike_do_not_stand_on_one_list(team, name):
    """Each alone is accepted: people are named so."""
    people = _people(team.root)
    people[0]["name"], people[-1]["name"] = "Rita Ray", name
    _write(team.root, people)
    assert load_allow_list(team.root).find("ada") is not None
    people[0]["name"] = "Ada LI" if name == "Ada Ll" else "Ada Li"
    _write(team.root, people)
    with pytest.raises(ConfigError, match=r"name is the same value twice"):
        load_allow_list(team.root)


@pytest.mark.parametrize(("one", "other"), [
    ("Rita Ray", "RitaRay"), ("Wanda", "VVanda"), ("Kam", "Karn"),
])  # fmt: skip
def test_whose_names_look_alike_reads_who_they_are_and_what_to_do(team, one, other):
    people = _people(team.root)
    people[0]["name"], people[-1]["name"] = one, other
    _write(team.root, people)
    who = f"{people[0]['id']} and {people[-1]['id']}"
    with pytest.raises(ConfigError, match=rf"twice to a reader's eye, of {who}, expected") as found:
        load_allow_list(team.root)
    assert "If they are two people, add a further name or where they work" in str(found.value)
    people[-1]["name"] = f"{other} of Fukuoka"
    _write(team.root, people)
    assert load_allow_list(team.root).find(people[-1]["id"]) is not None


def test_an_author_is_one_whatever_the_name(team):
    people = _people(team.root)
    people[-1]["name"] = "Rita of the south wing"
    _write(team.root, people)
    allowed = load_allow_list(team.root)
    assert dependence("rita", ["ada"], [allowed.find("rita")], allowed) == ""
    assert "author and reviewer" in dependence("ada", ["ada"], [], allowed)


@pytest.mark.parametrize(("spotter", "why"), [
    ("sam", ""), ("mo", ""), ("sue", ""), ("rita", "reviewer and spotter"),
    ("ada", "author and spotter"), ("nobody", "not on"), ("Sam", "not on"), ("", "not on"),
])  # fmt: skip
def test_at_the_stop_stands_somebody_of_the_list_who_neither_reviews_nor_made_it(
    team, spotter, why
):
    team.allow({**PEOPLE, **AUTHORS, "sue": "spotter"})
    allowed = load_allow_list(team.root)
    for reviewer in ("rita", ""):
        found = spotting(spotter, reviewer, ["ada"], allowed)
        assert (found == "") == (why == "") and why in found
    assert "author and spotter" in spotting("mo", "rita", ["ada", "mo"], allowed)
    assert "reviewer and spotter" in spotting("mo", "mo", ["ada"], allowed)


@pytest.mark.parametrize("field", ["id", "public_key", "emails"])
def test_one_person_has_one_entry(team, field):
    people = _people(team.root)
    people[1][field] = people[0][field]
    _write(team.root, people)
    with pytest.raises(ConfigError, match=f"{field}.*twice"):
        load_allow_list(team.root)


def test_an_address_in_other_letters_is_the_same_address(team):
    people = _people(team.root)
    people[1]["emails"] = ["RITA@example.org"]
    _write(team.root, people)
    with pytest.raises(ConfigError, match=r"emails.*twice"):
        load_allow_list(team.root)


def test_a_key_of_small_order_is_refused(team):
    people = _people(team.root)
    people[0]["public_key"] = "01" + "00" * 31
    _write(team.root, people)
    with pytest.raises(ConfigError, match="small order"):
        load_allow_list(team.root)


def test_authors_are_listed_people_who_sign_nothing(team):
    allowed = load_allow_list(team.root)
    signers = [allowed.find(name) for name in PEOPLE]
    assert isinstance(signers[0], Person)
    assert dependence("rita", ["ada"], signers, allowed) == ""
    assert "no author" in dependence("rita", [], signers, allowed)
    assert "'nobody' is not on" in dependence("rita", ["ada", "nobody"], signers, allowed)
    assert "author and reviewer" in dependence("rita", ["ada", "rita"], [], allowed)
    assert "mo is an author" in dependence("rita", ["ada", "mo"], signers, allowed)
    by_role = [*signers, *(allowed.find(name) for name in AUTHORS)]
    assert "ada is an author" in dependence("rita", ["mo"], [by_role[0], by_role[-1]], allowed)
