"""The desk: what is asked in each state of the ladder, numbers as people read them."""

import re
import sys
from pathlib import Path

import evidence
import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "card"))
from team import Team

from gates.closeness import closeness
from gates.evidence import Evidence
from gates.more import HARDLY
from gates.pages import page
from gates.pages.desk import HEADLINES, desk_of, remark
from gates.pages.desk_card import papers_of, signing_of
from gates.proof import judge
from gates.report import GATES, read_report
from gates.writing import write_gate, write_index


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
    assert "Measured 4 action steps; required at most 1 action step." in asked.text
    text = (ladder / "reports/index.html").read_text()
    assert asked.title in text and "Asked of you" not in text


def test_criteria_of_others_than_the_promoted_draw_no_bar(ladder):
    promoted = judge(ladder, "D").promoted
    named = {bar.near.answer.candidate for bar in desk(ladder).bars}
    assert named == {None, promoted}


def test_bars_and_exact_ones_are_all_that_hold(ladder):
    found = desk(ladder)
    shown = sum(part.hold for part in found.parts)
    assert len(found.bars) + found.exact == shown and found.bars
    used = [bar.near.used for bar in found.bars]
    assert used == sorted(used, reverse=True) and not any(bar.beyond for bar in found.bars)


def test_what_does_not_hold_has_the_first_bar_full_and_says_how_far(judged):
    """The one that decides must not be the one that is missing."""
    report = judged("A")
    by_id = {c.id: n for n, c in enumerate(report.criteria)}
    open_one, broken = by_id["remedy_valid_share"], by_id["clock_residual_s"]
    criteria = list(report.criteria)
    criteria[open_one] = criteria[open_one].model_copy(update={
        "verdict": "INCONCLUSIVE", "measured": 0.508, "interval": (0.356, 0.508), "threshold": 0.5,
    })  # fmt: skip
    criteria[broken] = criteria[broken].model_copy(update={
        "verdict": "FAIL", "measured": 0.013, "threshold": 0.01,
    })  # fmt: skip
    changed = report.model_copy(update={"criteria": tuple(criteria), "verdict": "FAIL"})
    found = desk_of({"A": changed})
    first, second, *others = found.bars
    assert (first.near.answer.id, first.beyond) == ("clock_residual_s", "over by 3 ms")
    assert second.near.answer.id == "remedy_valid_share"
    assert second.beyond == "the limit lies inside 35.6 to 50.8 %"
    assert (first.near.used, second.near.used) == (1.0, 1.0)
    assert all(bar.near.holds for bar in others)
    assert len(others) + found.exact == sum(part.hold for part in found.parts)


def test_the_page_draws_what_does_not_hold_in_red_and_says_it_before_any_gain(ladder):
    write_index(ladder)
    passed, gain = (ladder / "reports/index.html").read_text(), "the best simple policy, "
    assert passed.index(gain) < passed.index("<p>Promote ")
    evidence.edit_table(ladder, "audit/clocks.parquet", evidence.lags_apart)
    write_gate(ladder, "A")
    text = (ladder / "reports/index.html").read_text()
    assert text.index("Measured 4 action steps") < text.index(gain)
    row = text[text.index('class="bar broken"') :].partition("</tr>")[0]
    assert 'aria-label="over by 3 action steps"' in row
    assert '<rect class="used" width="100.0"' in row and "<small>over by 3 action steps" in row
    assert text.index('class="bar broken"') < text.index('class="bar"')


def test_an_owner_sees_beside_each_number_what_it_rests_on(ladder):
    write_index(ladder)
    text = (ladder / "reports/index.html").read_text()
    duties = text[text.index("7 · Your part") : text.index("8 · The gates")]
    (row,) = [row for row in duties.split("<tr ") if "#mode_success_lower" in row]
    assert ">at least 79.6 %</a><small>24 of 25 episodes</small></td>" in row
    (row,) = [row for row in duties.split("<tr ") if "#label_disagreement" in row]
    assert ">at most 8.81 %</a><small>none of 40 replays</small></td>" in row


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"verdict": "FAIL", "measured": 0.6}, "Measured 60 % (9 of 15 episodes); required at most "
         "50 %. Return to the dataset."),
        ({"verdict": "INCONCLUSIVE", "measured": 0.508, "interval": (0.356, 0.508),
          "caveat": "long; the limit lies inside the interval: about 2.3 times as many decide"},
         "Measured 35.6 to 50.8 % (9 of 15 episodes); required at most 50 %. About 2.3 times as "
         "many decide."),
        ({"verdict": "INCONCLUSIVE", "measured": None, "caveat": "not measured: no rows"},
         "Nothing was measured; required at most 50 %. No rows."),
    ],
)  # fmt: skip
def test_the_asked_box_says_what_was_found_what_is_required_and_what_would_decide(
    judged, changes, said
):
    """Where to look first, and what an audit found beside it, stand on the gate's page."""
    report = judged("A")
    own = next(c for c in report.criteria if c.id == "remedy_valid_share")
    plain = {"threshold": 0.5, "interval": None, "counted": "9 of 15 episodes"}
    own = own.model_copy(update={**plain, **changes})
    stopped = report.model_copy(update={
        "criteria": (own,), "verdict": own.verdict, "decision": "Return to the dataset.",
        "diagnosis": "First unmet: remedy_valid_share. Baselines: retrain.",
    })  # fmt: skip
    assert desk_of({"A": stopped}).asked.text == f"{own.question} {said}"
    advised = stopped.model_copy(update={"diagnosis": "Cause: one. Next: look. Next: try it."})
    more = " Next: try it." if own.verdict == "INCONCLUSIVE" else ""
    assert desk_of({"A": advised}).asked.text == f"{own.question} {said}{more}"


def test_watch_it_says_which_way_was_measured_and_which_was_commanded():
    """As `genpolicy.replay.film` draws: the hand where it was measured, the way as commanded."""
    template = (Path(page.__file__).parent / "templates/index.html").read_text()
    assert "The hand stands where it was measured; blue: the way that was commanded;" in template


def test_each_owner_finds_what_is_open(ladder):
    evidence.edit_table(ladder, "audit/clocks.parquet", evidence.lags_apart)
    write_gate(ladder, "A")
    [part] = [part for part in desk(ladder).parts if part.owner == "controller"]
    first = part.duties[0]
    assert (first.gate, first.answer.id, first.measured) == (
        "A",
        "lag_spread_rows",
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
        (
            {"verdict": "INCONCLUSIVE", "interval": (0.0, 9.0), "caveat": f"{HARDLY} now"},
            f"not decided: {HARDLY} now",
        ),
        ({"verdict": "FAIL", "measured": 5.0}, "c"),
        ({"verdict": "FAIL", "caveat": ""}, "nothing was recorded that answers it"),
        ({"measured": 1.9}, "near: 95 % of its room to the limit is used up"),
        (
            {"measured": 1.5, "interval": (0.4, 1.5)},
            "near: 75 % of its room to the limit is used up; what is left is less than half of "
            "its interval, so that another draw may break it",
        ),
        (
            {"measured": 1.0},
            "50 % of its room to the limit is used up; no interval says how sure that is",
        ),
        ({"measured": 1.0, "interval": (0.5, 1.0)}, "50 % of its room to the limit is used up"),
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
            other = "; judged over another report of gate A" if spoilt else ""
            assert (box.number, box.of) == ("none of 4", HEADLINES["E"][1] + other)
            continue
        said = [c for c in report.criteria if c.id == name]
        said = [c for c in said if c.candidate in (None, reports["D"].promoted)]
        shown = re.split(r", (?=[a-z])", box.number) if box.number else []
        assert len(shown) in (1, len(said)) if said[0].measured is not None else not shown
        for text, c in zip(shown, said, strict=False):
            assert _read(text.removeprefix(f"{c.candidate} ")) == (_side(c), _close(c.measured))
    for bar in found.bars:
        c = bar.near.answer
        assert c in reports[bar.gate].criteria and bar.near.holds == (c.verdict == "PASS")
        assert _read(bar.measured) == (_side(c), _close(c.measured))
        assert _read(bar.limit) == ("", _close(c.threshold))
        assert bool(bar.beyond) != bar.near.holds
        assert bar.near == closeness(c)


def test_each_owner_finds_all_of_theirs_and_nobody_elses(ladder):
    """Of candidates those of the one that Gate D promotes, at every gate."""
    write_gate(ladder, "E")  # waits for people
    evidence.edit_table(ladder, "audit/clocks.parquet", evidence.lags_apart)
    write_gate(ladder, "A")
    reports = {gate: read_report(ladder, gate)[0] for gate in GATES}
    promoted = reports["D"].promoted
    assert promoted and all(len(reports[gate].candidates) > 1 for gate in "BCD")
    for part in desk_of(reports).parts:
        own = [
            (gate, c) for gate, report in reports.items() for c in report.criteria
            if c.owner == part.owner and c.candidate in (None, promoted)
        ]  # fmt: skip
        assert part.hold == sum(c.verdict == "PASS" for _, c in own)
        assert sorted(map(_known, own)) == sorted(_known((d.gate, d.answer)) for d in part.duties)
        used = [_used(duty.answer) for duty in part.duties]
        assert used == sorted(used, reverse=True)


def _known(entry):
    gate, c = entry
    return gate, c.id, c.candidate or ""


def _used(c):
    """Above 1 what does not hold, then the share of the room, below 0 what has none."""
    if c.verdict != "PASS":
        return 2.0
    near = closeness(c)
    return -1.0 if near is None else near.used
