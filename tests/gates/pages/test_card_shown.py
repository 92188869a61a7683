"""Gate E's page shows what one signs as the desk does, and nothing raw."""

import re
import sys
from pathlib import Path

import evidence

sys.path.insert(0, str(Path(__file__).parents[1] / "card"))
from team import PEOPLE, Team

from gates.pages.card_shown import card_shown
from gates.writing import write_gate, write_index


def _table(page):
    return re.search(r'<table class="signing">.*?</table>', page, re.DOTALL)[0]


def test_what_one_signs_stands_on_both_pages_alike_and_its_caveats_are_linked(ladder):
    write_gate(ladder, "E")
    write_index(ladder)
    desk = (ladder / "reports/index.html").read_text()
    annex = (ladder / "reports/gate_e.html").read_text()
    assert _table(desk) == _table(annex) and "x 350 to 700" in _table(annex)
    assert "{&#39;" not in annex and "abort windows" not in annex
    assert re.search(r'<a href="gate_e.html#card-caveats">\d+ caveats</a>', desk)
    assert annex.count('id="card-caveats"') == 1
    assert annex.index("The card (draft, not signed)") < annex.index("<h2>Criteria</h2>")


def test_other_fields_are_those_that_do_not_stand_beside_what_was_seen(ladder):
    report = write_gate(ladder, "E")
    state, fields, signing = card_shown(ladder, report)
    assert state == "draft, not signed" and signing is not None
    names = {name for name, _ in fields}
    assert {"candidate", "authors", "reports", "caveats", "reviewer", "nonce"} <= names
    assert not names & {"stop path", "spotter", "rollback", "abort windows", "expires"}


def test_a_card_of_other_reports_is_shown_field_by_field_with_its_windows_in_words(ladder):
    """Nothing stands beside what was seen by other bytes; a window reads as a person says it."""
    write_gate(ladder, "E")
    report = write_gate(ladder, "E")
    path = ladder / "reports/gate_d.json"
    path.write_bytes(path.read_bytes() + b" ")
    state, fields, signing = card_shown(ladder, report)
    assert signing is None and state == "draft, not signed"
    windows = dict(fields)["abort windows"]
    assert windows and not any("{" in line for line in windows)
    assert dict(fields)["speed limit, m/s"] == ["0.25"]


def test_a_card_says_how_far_it_is_signed(ladder):
    team = Team(ladder)
    path = team.complete()
    for count, name in enumerate(PEOPLE, start=1):
        team.sign(path, [name])
        evidence.record(ladder)
        state = card_shown(ladder, write_gate(ladder, "E"))[0]
        assert state == (f"signed by {count} of 5" if count < 5 else "signed")


def test_no_other_gate_has_a_card(ladder):
    assert card_shown(ladder, write_gate(ladder, "A")) == ("", [], None)
