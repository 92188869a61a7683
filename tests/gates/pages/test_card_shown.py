"""Gate E's page shows what one signs as the desk does, and nothing raw."""

import re
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "card"))
from team import PEOPLE, Team

from gates.pages.card_shown import card_shown
from gates.pages.page import gate_page


def test_what_one_signs_stands_on_the_page_of_the_gate_with_nothing_raw(whole, judged):
    page = gate_page(whole, judged("E"))
    table = re.search(r'<table class="signing">.*?</table>', page, re.DOTALL)[0]
    _, _, signing = card_shown(whole, judged("E"))
    cells = [cell for item in signing.items for cell in (item.field, item.proposed)]
    assert len(cells) > 20 and all(f">{cell}</t" in table for cell in cells)
    assert "x 350 to 700" in table
    assert "{&#39;" not in page and "abort windows" not in page
    assert page.count('id="card-caveats"') == 1
    assert page.index("The card (draft, not signed)") < page.index("<h2>Criteria</h2>")


def test_other_fields_are_those_that_do_not_stand_beside_what_was_seen(whole, judged):
    state, fields, signing = card_shown(whole, judged("E"))
    assert state == "draft, not signed" and signing is not None
    names = {name for name, _ in fields}
    assert {"candidate", "authors", "reports", "caveats", "reviewer", "nonce"} <= names
    assert not names & {"stop path", "spotter", "rollback", "abort windows", "expires"}


def test_a_card_of_other_reports_is_shown_field_by_field_with_its_windows_in_words(copied, judged):
    """Nothing stands beside what was seen by other bytes; a window reads as a person says it."""
    path = copied / "reports/gate_d.json"
    path.write_bytes(path.read_bytes() + b" ")
    state, fields, signing = card_shown(copied, judged("E"))
    assert signing is None and state == "draft, not signed"
    shown = dict(fields)
    assert shown["abort windows"] and not any("{" in line for line in shown["abort windows"])
    assert shown["speed limit, m/s"] == ["0.25"]


def test_a_card_says_how_far_it_is_signed(copied, judged):
    team = Team(copied)
    path = team.complete()
    for count, name in enumerate(PEOPLE, start=1):
        team.sign(path, [name])
        state = card_shown(copied, judged("E"))[0]
        assert state == (f"signed by {count} of 5" if count < 5 else "signed")


def test_no_other_gate_has_a_card(whole, judged):
    assert card_shown(whole, judged("A")) == ("", [], None)
