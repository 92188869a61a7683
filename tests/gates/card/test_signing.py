"""Trial card and Gate E: pending until people sign; forged cards are refused (P21)."""

import pytest
import yaml
from team import PEOPLE

from gates.card.signing import load_allow_list, sign_card
from genpolicy.errors import BadInputError, ConfigError


def test_signing_in_turns_waits_for_the_last_owner(team):
    path = team.complete()
    for name in PEOPLE:
        assert team.judge().verdict != "PASS"
        path = team.sign(path, [name])
    assert team.judge().verdict == "PASS"


@pytest.mark.parametrize(
    ("changes", "name", "text"),
    [
        ({"force_limit_n": None}, "Rita Reviewer", "incomplete"),
        ({"candidate": "flow"}, "Rita Reviewer", "candidate"),
        ({"reviewer": "Someone Else"}, "Rita Reviewer", "Someone Else"),
        ({}, "Eve", "listed person"),
    ],
)
def test_signing_refuses_what_cannot_pass(team, changes, name, text):
    with pytest.raises(BadInputError, match=text):
        team.sign(team.complete(**changes), [name])
    assert not team.envelope.exists()


def test_signing_with_another_persons_key_is_refused(team):
    with pytest.raises(BadInputError, match="another key"):
        sign_card(
            team.root,
            card_file=team.complete(),
            key_file=team.folder / "Eve",
            reviewer="Rita Reviewer",
        )


def test_one_person_cannot_hold_two_roles(team):
    entry = yaml.safe_load((team.root / "reviewers.yaml").read_text())["people"]
    for twin in ({**entry[0], "name": "Other"}, {**entry[0], "public_key": "ab" * 32}):
        (team.root / "reviewers.yaml").write_text(yaml.safe_dump({"people": [*entry, twin]}))
        with pytest.raises(ConfigError, match="twice"):
            load_allow_list(team.root)


def test_the_shipped_allow_list_names_nobody(request):
    assert load_allow_list(request.config.rootpath).people == ()
