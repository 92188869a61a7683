"""Bars, duties and doubts of the desk are of the candidate that it asks about."""

import html

import pytest
from test_differences import REPORT
from test_verdicts import criterion

from gates.doubts import doubts_of, for_a_card
from gates.pages import page
from gates.pages.desk import desk_of
from gates.pages.desk_about import answers_about, asked_about, doubts_about
from gates.writing import write_gate


def of(gate, verdict="PASS", promoted=None, **candidates):
    return REPORT.model_copy(
        update={"gate": gate, "verdict": verdict, "candidates": candidates, "promoted": promoted}
    )


@pytest.mark.parametrize(("reports", "about"), [
    ([], ()),
    ([of("A")], ()),
    ([of("A"), of("B", a="PASS", b="PASS", c="FAIL")], ("a", "b")),
    ([of("B", a="PASS", b="PASS"), of("C", a="FAIL", b="PASS")], ("b",)),
    ([of("B", a="PASS", b="PASS"), of("C", "FAIL", a="FAIL", b="FAIL")], ("a", "b")),
    ([of("B", a="FAIL", b="PASS"), of("C", "FAIL", a="PASS", b="FAIL")], ("b",)),
    ([of("B", a="PASS", b="PASS"), of("C", a="PASS", b="PASS"),
      of("D", promoted="b", a="PASS", b="PASS")], ("b",)),
    ([of("B", a="PASS", b="PASS"), of("C", a="FAIL", b="PASS"),
      of("D", "INCONCLUSIVE", b="INCONCLUSIVE")], ("b",)),
    ([of("B", "FAIL", a="FAIL", b="FAIL"), of("C", a="PASS", b="FAIL")], ("a", "b")),
])  # fmt: skip
def test_one_is_asked_about_whom_gate_d_promotes_until_then_who_still_stands(reports, about):
    assert asked_about({report.gate: report for report in reports}) == about


def test_of_a_gate_that_judges_none_of_them_every_answer_is_shown():
    rows = tuple(criterion("PASS", who) for who in (None, "a", "b"))
    report = of("B", a="PASS", b="PASS").model_copy(update={"criteria": rows})
    assert [c.candidate for c in answers_about(report, ["b", "z"])] == [None, "b"]
    assert answers_about(report, ["z"]) == answers_about(report, ["a", "b"]) == list(rows)


@pytest.fixture
def reports(judged):
    return {gate: judged(gate) for gate in "ABCD"}


def test_every_gate_shows_numbers_and_duties_of_the_promoted_alone(reports):
    promoted = reports["D"].promoted
    found = desk_of(reports)
    assert found.about == (promoted,)
    assert {bar.near.answer.candidate for bar in found.bars} == {None, promoted}
    duties = [duty for part in found.parts for duty in part.duties]
    assert {duty.answer.candidate for duty in duties} == {None, promoted}
    assert {duty.gate for duty in duties if duty.answer.candidate} == set("BCD")
    assert not any("diffusion" in box.number for box in found.boxes)


def test_doubts_about_others_come_last_and_folded_and_none_is_lost(reports):
    promoted = reports["D"].promoted
    (other,) = reports["D"].candidates.keys() - {promoted}
    doubts, _, others = doubts_about(reports, [promoted])
    assert not any(other in doubt.text or doubt.candidate == other for doubt in doubts)
    assert others and all(doubt.candidate in ("", other) for doubt in others)
    assert any(other in doubt.text for doubt in others)
    every = {doubt.text for report in reports.values() for doubt in doubts_of(report)}
    about_other = {text for text in every if other in text and promoted not in text}
    assert about_other and about_other <= {doubt.text for doubt in others}


def test_a_doubt_that_the_card_has_is_not_folded(reports):
    promoted = reports["D"].promoted
    shown = {doubt.text for doubt in doubts_about(reports, [promoted])[0]}
    card = [text for report in reports.values() for text in for_a_card(report, promoted)]
    assert card and {text.partition(": ")[2] for text in card} <= shown


def test_what_stopped_another_is_read_beside_the_promoted():
    fell = criterion("FAIL", "b", "n"), criterion("INCONCLUSIVE", "b", "m")
    report = of("B", a="PASS", b="FAIL").model_copy(update={"criteria": fell, "caveats": ()})
    doubts, _, others = doubts_about({"B": report}, ["a"])
    assert [(doubt.kind, doubt.text) for doubt in doubts] == [("stopped here", "b: n")]
    assert [doubt.kind for doubt in others] == ["not measured"]


def test_the_page_has_them_in_a_fold_behind_all_others(copied):
    write_gate(copied, "E")
    text = html.unescape(page.index_page(copied))
    part = text[text.index("1 · What could") : text.index("2 · How close")]
    listed, _, folds = part.partition("<details")
    assert "diffusion" not in listed and "flow" in listed
    *_, last = folds.split("<details")
    assert "about other candidates than flow, which nobody asks about</summary>" in last
    assert "(diffusion)" in last
