"""Words for readers: units, labels, and a guide to every gate."""

import pytest

from gates.pages.guide import QUESTIONS, READING, USED, WORDS, label
from gates.readable import unit
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
