"""The desk: what is asked in each state of the ladder, numbers as people read them."""

import re
import sys
from pathlib import Path

import evidence
import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "card"))
from team import Team

from gates.evidence import Evidence
from gates.pages.desk import HEADLINES, desk_of, remark
from gates.pages.desk_card import papers_of, signing_of
from gates.proof import judge
from gates.report import GATES, read_report
from gates.writing import write_gate


def desk(ladder):
    found = {}
    for gate in GATES:
        if (ladder / f"reports/gate_{gate.lower()}.json").is_file():
            found[gate] = read_report(ladder, gate)[0]
    at = Evidence(ladder)
    return desk_of(found, signing_of(found, at, papers_of(found, at)).pending)


def test_of_nothing_nothing_is_asked():
    empty = desk_of({})
    assert empty.asked.title.startswith("Nothing is asked of you yet: the ladder stops at gate A")
    assert {box.verdict for box in empty.boxes} == {"NOT JUDGED"} and not empty.bars
    assert all((part.hold, part.duties) == (0, ()) for part in empty.parts)


def test_a_passed_ladder_asks_for_the_promoted_and_says_what_waits(ladder):
    before = desk(ladder)
    assert before.asked.title.startswith("Asked of you: let ")
    assert before.asked.pending == "the card is not drawn"
    write_gate(ladder, "E")
    assert desk(ladder).asked.pending == "5 signatures, 7 fields"
    page = (ladder / "reports/index.html").read_text()
    assert "<b>5 signatures, 7 fields.</b> Nothing moves before." in page
    assert re.search(r'<a href="gate_e.html#card-caveats">\d+ caveats</a>', page)
    box = desk(ladder).boxes[-1]
    assert (box.verdict, box.number, box.of) == (
        "PENDING_REVIEW",
        "none of 4",
        "owners have signed",
    )
    assert "not measured: owners" not in page


def test_a_card_that_some_signed_says_who_lacks_and_not_that_it_is_not_drawn(ladder):
    team = Team(ladder)
    team.sign(team.complete(), ["mo", "sam"])
    evidence.record(ladder)
    write_gate(ladder, "E")
    found = desk(ladder)
    assert found.asked.pending == "3 signatures"
    assert (found.boxes[-1].verdict, found.boxes[-1].number) == ("PENDING_REVIEW", "2 of 4")
    page = (ladder / "reports/index.html").read_text()
    assert "Signed by mo (model), sam (safety)." in page and "do not fill it again" in page
    annex = (ladder / "reports/gate_e.html").read_text()
    assert "The card (signed by 2 of 5)" in annex


def test_of_a_card_that_is_refused_the_desk_says_so(ladder):
    team = Team(ladder)
    team.sign(team.complete(), ["mo"])
    team.allow({})
    evidence.record(ladder)
    write_gate(ladder, "E")
    found = desk(ladder)
    assert found.asked.pending == "the card that lies here is refused"
    assert (found.boxes[-1].verdict, found.boxes[-1].number) == ("FAIL", "none of 4")


def test_a_stopped_ladder_says_where_by_what_and_never_asks(ladder):
    evidence.edit_table(ladder, "audit/clocks.parquet", evidence.lags_apart)
    write_gate(ladder, "A")
    asked = desk(ladder).asked
    assert asked.title.startswith("Nothing is asked of you yet: the ladder stops at gate A")
    assert "Measured 4 action steps; required at most 1 action steps." in asked.text
    text = (ladder / "reports/index.html").read_text()
    assert asked.title in text and "Asked of you" not in text


def test_criteria_of_others_than_the_promoted_draw_no_bar(ladder):
    promoted = judge(ladder, "D").promoted
    named = {bar.near.answer.candidate for bar in desk(ladder).bars if bar.gate == "D"}
    assert named == {None, promoted}


def test_bars_and_exact_ones_are_all_that_hold(ladder):
    found = desk(ladder)
    shown = sum(part.hold for part in found.parts)
    assert len(found.bars) + found.exact == shown
    assert [bar.near.used for bar in found.bars] == sorted(
        (bar.near.used for bar in found.bars), reverse=True
    )


def test_each_owner_finds_what_is_open(ladder):
    evidence.edit_table(ladder, "audit/clocks.parquet", evidence.lags_apart)
    write_gate(ladder, "A")
    [part] = [part for part in desk(ladder).parts if part.owner == "controller"]
    first = part.duties[0]
    assert (first.gate, first.answer.id, first.measured) == (
        "A",
        "lag_spread_steps",
        "4 action steps",
    )
    assert first.remark == first.answer.caveat
    assert part.hold == sum(duty.answer.verdict == "PASS" for duty in part.duties)
    text = (ladder / "reports/index.html").read_text()
    assert "<details open><summary><b>controller</b>" in text
    assert "<details><summary><b>perception</b>" in text


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"verdict": "INCONCLUSIVE"}, "not measured: c"),
        (
            {"verdict": "INCONCLUSIVE", "interval": (0.0, 9.0)},
            "not decided, more evidence decides: c",
        ),
        ({"verdict": "FAIL", "measured": 5.0}, "c"),
        ({"verdict": "FAIL", "caveat": ""}, "nothing was recorded that answers it"),
        ({"measured": 1.9}, "near: 95 % of the limit is used up, and another draw may break it"),
        ({"measured": 1.0}, "50 % of the limit is used up; no interval says how sure that is"),
        ({"measured": 1.0, "interval": (0.5, 1.0)}, "50 % of the limit is used up"),
        ({"measured": 0.0, "threshold": 0.0}, "holds exactly; there is no room to speak of"),
    ],
)  # fmt: skip
def test_a_remark_says_what_its_owner_has_to_look_at(judged, changes, said):
    plain = {
        "comparison": "<=", "threshold": 2.0, "interval": None, "verdict": "PASS", "caveat": "c",
    }  # fmt: skip
    assert remark(judged("A").criteria[0].model_copy(update={**plain, **changes})) == said


FACTORS = {"ms": 1e-3, "mm": 1e-3, "%": 1e-2}


def _read(text):
    """Side and number, in units of the evidence, of what a person reads on the desk."""
    side, number, unit = re.fullmatch(r"(at most |at least |)×?([-+.e\d,]+) ?(.*)", text).groups()
    return side.strip(), float(number.replace(",", "")) * FACTORS.get(unit, 1.0)


def _close(value):
    return pytest.approx(value, rel=0.006)  # three digits are shown


def _side(answer):
    """Of the end that was judged, whichever it is."""
    low, high = answer.interval or (None, None)
    return (
        {high: "at most", low: "at least"}.get(answer.measured, "")
        if low != high
        else ("" if low is None else {"<=": "at most", ">=": "at least"}[answer.comparison])
    )


@pytest.mark.parametrize("spoilt", [False, True])
def test_every_number_of_the_desk_is_one_of_the_reports(ladder, spoilt):
    write_gate(ladder, "E")
    if spoilt:
        evidence.edit_table(ladder, "audit/clocks.parquet", evidence.lags_apart)
        write_gate(ladder, "A")
    reports = {gate: read_report(ladder, gate)[0] for gate in GATES}
    found = desk_of(reports)
    for gate, box in zip(GATES, found.boxes, strict=True):
        report, name = reports[gate], HEADLINES[gate][0]
        assert (box.gate, box.verdict) == (gate, report.verdict)
        if gate == "E":
            assert (box.number, box.of) == ("none of 4", HEADLINES["E"][1])
            continue
        said = [c for c in report.criteria if c.id == name]
        said = [c for c in said if c.candidate in (None, report.promoted)] or said
        shown = re.split(r", (?=[a-z])", box.number) if box.number else []
        assert len(shown) in (1, len(said)) if said[0].measured is not None else not shown
        for text, c in zip(shown, said, strict=False):
            assert _read(text.removeprefix(f"{c.candidate} ")) == (_side(c), _close(c.measured))
    for bar in found.bars:
        c = bar.near.answer
        assert c in reports[bar.gate].criteria and c.verdict == "PASS"
        assert _read(bar.measured) == (_side(c), _close(c.measured))
        assert _read(bar.limit) == ("", _close(c.threshold))
        ends = (c.measured, c.threshold) if c.comparison == "<=" else (c.threshold, c.measured)
        assert bar.near.used == pytest.approx(max(ends[0], 0.0) / ends[1])


def test_each_owner_finds_all_of_theirs_and_nobody_elses(ladder):
    """Of candidates those of the promoted, or of all that pass their gate."""
    write_gate(ladder, "E")  # waits for people
    evidence.edit_table(ladder, "audit/clocks.parquet", evidence.lags_apart)
    write_gate(ladder, "A")
    reports = {gate: read_report(ladder, gate)[0] for gate in GATES}

    def counts(report, candidate):
        passing = [n for n, verdict in report.candidates.items() if verdict == "PASS"]
        return candidate in (None, *([report.promoted] if report.promoted else passing))

    for part in desk_of(reports).parts:
        own = [
            (gate, c) for gate, report in reports.items() for c in report.criteria
            if c.owner == part.owner and counts(report, c.candidate)
        ]  # fmt: skip
        assert part.hold == sum(c.verdict == "PASS" for _, c in own)
        assert sorted(map(_known, own)) == sorted(_known((d.gate, d.answer)) for d in part.duties)
        used = [_used(duty.answer) for duty in part.duties]
        assert used == sorted(used, reverse=True)


def _known(entry):
    gate, c = entry
    return gate, c.id, c.candidate or ""


def _used(c):
    """Above 1 what does not hold, then the share of the limit, below 0 what has none."""
    if c.verdict != "PASS":
        return 2.0
    exact = c.comparison == ">=" and c.threshold == c.measured == 1
    if exact or c.measured is None or not c.threshold or c.threshold <= 0:
        return -1.0
    return c.threshold / c.measured if c.comparison == ">=" else max(c.measured, 0.0) / c.threshold
