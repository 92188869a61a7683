"""Words for readers: units, labels, and a guide to every gate."""

import re
from collections import defaultdict

import pytest

from gates.pages.guide import BACK_TO, QUESTIONS, READING, USED, WORDS, label
from gates.readable import unit
from gates.report import GATES, NAMES
from gates.writing import write_gate


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("clock_residual_s", "s"),
        ("lag_spread_rows", "action steps"),
        ("projection_p95_m", "m"),
        ("boundary_jerk_p95_m_s3", "m/s³"),
        ("force_peak_p95_n", "N"),
        ("mode_success_lower", ""),
        ("unmatched_starts", ""),
        ("held_out_situations", ""),
    ],
)
def test_units_follow_the_suffix(name, text):
    assert unit(name) == text


def test_every_gate_has_a_reading_guide_whose_words_exist():
    assert set(QUESTIONS) == set(READING) == set(USED) == set("ABCDE")
    assert {word for used in USED.values() for word in used} == set(WORDS)


def test_fields_of_the_card_carry_their_unit(ladder):
    assert label("speed_limit_m_s") == "speed limit, m/s"
    assert label("force_limit_n") == "force limit, N"
    assert label("stop_path") == "stop path"
    write_gate(ladder, "E")
    page = (ladder / "reports/gate_e.html").read_text()
    assert f">{label('robot_model')}</th>" in page
    assert page.index("The card (draft, not signed)") < page.index("<h2>Criteria</h2>")


def test_the_picture_of_the_gates_says_of_each_what_the_pages_say(request):
    """Its name above, where a no sends back below, each in the column of its letter."""
    picture = (request.config.rootpath / "docs/pictures/concepts.svg").read_text()
    columns = defaultdict(list)
    for x, text in re.findall(r'<text x="(\d+)"[^>]*>([^<]*)</text>', picture):
        columns[x].append(text)
    said = {}
    for texts in columns.values():
        for gate in set(texts) & set(GATES):
            said[gate] = " ".join(text for text in texts if text != gate)
    assert said == {gate: f"{NAMES[gate]} back to {BACK_TO[gate]}" for gate in GATES}
    (told,) = re.findall(r"<desc[^>]*>(.*?)</desc>", picture)
    assert all(f"{gate} {NAMES[gate]}" in told for gate in GATES)
    assert all(f"{gate} to {BACK_TO[gate]}" in told for gate in GATES)
