"""What could make a verdict wrong: a planted weakness of each kind is named, and none invented."""

import re

import evidence
import pytest
from test_differences import REPORT
from test_verdicts import criterion

from gates.card.card import caveats_of
from gates.card.searched import NOBODY
from gates.card.signing import read_draft
from gates.doubt import Doubt
from gates.doubts import OF_ALL, doubts_of, for_a_card, of_a_ladder
from gates.proof import judge
from gates.report import Overridden
from gates.stress.visited import BEYOND


def kinds(report):
    return [doubt.kind for doubt in doubts_of(report)]


def test_what_is_missing_is_the_first_doubt(ladder):
    evidence.replace(ladder, "audit/strata.parquet", None)
    report = judge(ladder, "A")
    found = doubts_of(report)
    lacking = [c.id for c in report.criteria if c.verdict == "INCONCLUSIVE"]
    assert [d.criteria[0] for d in found if d.kind == "not measured"] == lacking
    assert "strata_effect" in lacking and found[0].kind == "not measured"
    assert "strata.parquet" in found[lacking.index("strata_effect")].text


def test_a_limit_inside_its_interval_is_not_decided_and_says_why(judged):
    report = judged("A")
    (told,) = [c for c in report.criteria if c.id == "told_share"]
    astride = told.model_copy(
        update={"verdict": "INCONCLUSIVE", "interval": (0.1, 0.6), "caveat": "four of ten."}
    )
    open_one = report.model_copy(update={"criteria": (astride,)})
    doubt = doubts_of(open_one)[0]
    assert doubt.kind == "not decided" and doubt.text == f"{told.question} Four of ten."


def test_a_limit_moved_to_what_was_measured_is_near(ladder, judged):
    held = next(c for c in judged("A").criteria if c.id == "chunking_valid_share")
    assert "chunking_valid_share" not in _near(judged("A"))
    evidence.write_params(ladder, evidence.set_limit("gate_a", held.id, held.measured * 1.05))
    report = judge(ladder, "A")
    assert "chunking_valid_share" in _near(report)
    (text,) = [d.text for d in doubts_of(report) if d.criteria == (held.id,)]
    assert "95.2 % of its room to the limit is used up, at the worse end of its interval;" in text
    assert "another draw may break it." in text  # 5 of 105 are less than half of the interval


def test_a_number_without_an_interval_is_said_to_be_one(judged):
    report = judged("A")
    (points,) = [d for d in doubts_of(report) if d.kind == "judged at a point"]
    assert "mode_feasible_share" in points.criteria
    assert "told_share" not in points.criteria and "data_defects" not in points.criteria
    assert points.text.startswith(f"{len(points.criteria)} criteria")


@pytest.mark.parametrize(
    ("count", "shown"),
    [(1, "n0"), (3, "n0, n1, n2"), (4, "n0, n1, n2 and 1 more"), (6, "n0, n1, n2 and 3 more")],
)
def test_three_numbers_at_a_point_are_named_and_the_others_counted(count, shown):
    """Of two candidates a criterion is one; what has an interval is none of them."""
    far = {"measured": 0.1}
    points = [criterion("PASS", who, f"n{n}").model_copy(update=far) for n in range(count)
              for who in ("act", "flow")]  # fmt: skip
    judged = criterion("PASS", None, "z").model_copy(update={**far, "interval": (0.0, 0.2)})
    (doubt,) = doubts_of(REPORT.model_copy(update={"criteria": (*points, judged), "caveats": ()}))
    said = f"{count} criteria hold for what was drawn, without an interval: {shown}"
    assert (doubt.kind, doubt.text) == ("judged at a point", said)
    assert doubt.criteria == tuple(f"n{n}" for n in range(count)) and doubt.candidate == ""


@pytest.mark.parametrize(("caveat", "why"), [
    ("", "Nothing was recorded that answers it."), ("no rows", "No rows."), ("s is 3.", "S is 3."),
])  # fmt: skip
@pytest.mark.parametrize("candidate", [None, "flow"])
def test_what_a_doubt_about_a_criterion_says_to_a_person(caveat, why, candidate):
    lacking = criterion("INCONCLUSIVE", candidate).model_copy(update={"caveat": caveat})
    report = REPORT.model_copy(update={"criteria": (lacking,), "caveats": ()})
    who = " (flow)" if candidate else ""
    assert doubts_of(report) == [
        Doubt("A", "not measured", f"?{who} {why}", ("x",), candidate or "")
    ]


@pytest.mark.parametrize("verdict", ["PASS", "FAIL", "INCONCLUSIVE"])
def test_who_fell_is_said_in_the_order_of_names_and_only_where_somebody_passes(verdict):
    fell = [criterion("FAIL", who, name) for who, name in (("b", "n"), ("a", "m"), ("a", "k"))]
    report = REPORT.model_copy(update={
        "criteria": (*fell, criterion("FAIL", "c")), "verdict": verdict, "caveats": (),
        "candidates": {"b": "FAIL", "a": "FAIL", "c": "PASS"},
    })  # fmt: skip
    texts = [doubt.text for doubt in doubts_of(report)]
    assert texts == (["a: m, k", "b: n"] if verdict == "PASS" else [])


def test_a_candidate_that_fell_away_is_named_where_another_passes(ladder):
    def slow(frame):
        hit = (frame["method"] == "diffusion") & (frame["run"] == 2)
        hit &= frame["source"] == "measured"  # what is declared stays between its ends
        return frame.assign(seconds=frame["seconds"].where(~hit, frame["seconds"] * 9))

    evidence.edit_table(ladder, "latency/latency.parquet", slow)
    report = judge(ladder, "B")
    (stopped,) = [d for d in doubts_of(report) if d.kind == "stopped here"]
    assert stopped.text.startswith("diffusion: warm_latency_ratio_upper")


@pytest.mark.parametrize("gate", "ABCD")
def test_every_caveat_is_repeated_and_comes_last(judged, gate):
    report = judged(gate)
    found = doubts_of(report)
    general = tuple(caveat for caveat in report.caveats if not BEYOND.match(caveat))
    count = len(general)
    assert tuple(doubt.text for doubt in found[-count:]) == general
    assert "not shown" not in kinds(report)[:-count]
    visited = [doubt.text for doubt in found if doubt.kind == "not visited"]
    assert visited == [caveat for caveat in report.caveats if caveat not in general]
    assert bool(visited) == (gate == "D"), "a rule speaks of them, and each counts"


def test_what_a_card_is_signed_in_spite_of_speaks_of_its_candidate(judged):
    report = judged("D")
    promoted = report.promoted
    other = next(name for name in report.candidates if name != promoted)
    held = next(c for c in report.criteria if c.candidate == promoted and c.comparison == "<=")
    near = {"verdict": "PASS", "interval": None, "measured": 0.95, "threshold": 1.0}
    mine = held.model_copy(update=near)
    theirs = held.model_copy(update={**near, "candidate": other})
    fallen = held.model_copy(update={"id": "fell", "candidate": other, "verdict": "FAIL"})
    narrow = report.model_copy(
        update={
            "criteria": (mine, theirs, fallen),
            "candidates": {**report.candidates, other: "FAIL"},
        }
    )
    assert sum(d.kind == "near its limit" for d in doubts_of(narrow)) == 2
    said = for_a_card(narrow, promoted)
    near_texts = [text for text in said if "95 % of its room to the limit is used up" in text]
    assert len(near_texts) == 1 and f"({promoted})" in near_texts[0]
    assert f"Gate D, stopped here: {other}: fell" in said
    assert not any(caveat in text for caveat in report.caveats for text in said)


def test_a_draft_says_what_could_make_its_reports_wrong(ladder, reports):
    doubts = [text for gate in "ABCD" for text in for_a_card(reports[gate], reports["D"].promoted)]
    kinds_said = {text.split(":")[0] for text in doubts}
    assert {f"Gate {gate}, judged at a point" for gate in "AD"} <= kinds_said
    assert {"Gate B, declared", "Gate D, one training seed"} <= kinds_said
    caveats = caveats_of(reports)
    assert set(doubts) <= set(caveats) and caveats[-1] == doubts[-1]
    assert (*caveats, NOBODY) == read_draft(ladder).caveats, "and nobody searched for a failure"


def _near(report):
    return [doubt.criteria[0] for doubt in doubts_of(report) if doubt.kind == "near its limit"]


# -- of all gates together ------------------------------------------------------------------------


@pytest.fixture
def reports(judged):
    return {gate: judged(gate) for gate in "ABCD"}


def test_the_gravest_kind_comes_first_whatever_its_gate(reports):
    first, rest = of_a_ladder(reports.values())
    order = [doubt.kind for report in reports.values() for doubt in doubts_of(report)]
    ranks = [
        "not asked", "two clocks", "not measured", "not decided", "never exercised",
        "hardly exercised", "not visited", "not testable", "stopped here", "cold start",
        "an average", "a simpler rule passes", "small n", "one training seed", "declared",
        "near its limit", "judged at a point",
    ]  # fmt: skip
    found = [ranks.index(doubt.kind) for doubt in first]
    assert found == sorted(found) and len(set(found)) > 1
    assert {doubt.kind for doubt in rest} == {"not shown"}
    weighed = {doubt.kind for doubt in first if doubt.kind not in ("not asked", "two clocks")}
    assert weighed == {kind for kind in order if kind != "not shown"}


def test_on_the_first_page_no_doubt_is_lost_and_none_is_said_twice(reports):
    """Each kind of each gate stays, and of what holds of both candidates alike each name."""
    first, rest = of_a_ladder(reports.values())
    every = [doubt for report in reports.values() for doubt in doubts_of(report)]
    kept = {(gate, doubt.kind) for doubt in first for gate in (doubt.gate, *doubt.also)}
    assert {(d.gate, d.kind) for d in every if d.kind != "not shown"} <= kept
    texts = [doubt.text for doubt in (*first, *rest)]
    nameless = [re.sub(r"\b(diffusion|flow)\b( and flow, each)?", "X", text) for text in texts]
    assert len(set(nameless)) == len(nameless) < len(every)
    cold = [doubt for doubt in first if doubt.kind == "cold start"]
    assert [(doubt.criteria, doubt.candidate) for doubt in cold] == [(("latency_p95_s",), "")]
    assert "(diffusion and flow, each)" in cold[0].text


def test_what_each_gate_repeats_is_said_once_by_who_names_most(reports):
    rehearsal, loosened = list(OF_ALL)[:2]
    waived = "a_b was not asked: the safety owner says that it does not apply here (none)."
    told = []
    for n, (gate, report) in enumerate(reports.items(), start=1):
        repeated = f"{rehearsal} Looser: {'x' * n}.", f"{loosened}: {'y' * n}."
        caveats = (*repeated, "the same", f"own of {gate}", waived)
        told.append(report.model_copy(update={"caveats": caveats}))
    first, rest = of_a_ladder(told)
    assert [(doubt.kind, doubt.gate) for doubt in first[:3]] == [
        ("a rehearsal", "D"), ("limits loosened", "D"), ("not asked", "A"),
    ]  # fmt: skip
    own = [f"own of {gate}" for gate in reports]
    assert sorted(doubt.text for doubt in rest) == sorted(["the same", *own])
    assert [doubt.gate for doubt in rest if doubt.text == "the same"] == ["A"], "the first says it"


@pytest.mark.parametrize(("listed", "said"), [
    (["a (1 -> 2)", "b (None -> ['x, y'])", "c.d (0 -> 1)"], None),
    (["a (1 -> 2)", "b (None -> ['x, y (z)', 'u'])", "c.d (0 -> 1)", "e (1 -> 2)", "f (0 -> 3)"],
     "a (1 -> 2), b (None -> ['x, y (z)', 'u']), c.d (0 -> 1) and 2 more"),
])  # fmt: skip
@pytest.mark.parametrize("head", list(OF_ALL)[1:])
def test_of_many_limits_that_moved_the_first_are_named_and_the_others_counted(head, listed, said):
    caveat = f"{head}: {', '.join(listed)}."
    (doubt,), _ = of_a_ladder([REPORT.model_copy(update={"criteria": (), "caveats": (caveat,)})])
    assert doubt.text == (f"{head}: {said}. The caveats of the gate name all." if said else caveat)


def test_of_what_a_rehearsal_loosens_the_first_are_named_and_the_others_counted():
    head = f"{next(iter(OF_ALL))} Looser"
    caveat = f"{head}: a, b_c, d.e, stress.perturbations: camera_delay, f."
    (doubt,), _ = of_a_ladder([REPORT.model_copy(update={"criteria": (), "caveats": (caveat,)})])
    assert doubt.text == f"{head}: a, b_c, d.e and 2 more. The caveats of the gate name all."


@pytest.mark.parametrize(("said", "weighed"), [
    ("flow: the virtual clock and the wall clock differ (age; 48 episodes).", True),
    ("flow: the wall clock was not looked at (no rows).", True),
    ("flow: the virtual clock and the wall clock agree (age; 48 episodes).", False),
])  # fmt: skip
def test_clocks_that_differ_are_no_general_caveat(reports, said, weighed):
    report = reports["D"].model_copy(update={"caveats": (said,)})
    first, rest = of_a_ladder([report])
    assert [doubt.text for doubt in first if doubt.kind == "two clocks"] == [said] * weighed
    assert [doubt.text for doubt in rest] == [said] * (not weighed)


def test_who_holds_by_an_exception_did_not_fall_by_it():
    """What stopped a candidate is what counts: the exception is said by itself."""
    rows = tuple(criterion("FAIL", "flow", name) for name in ("excepted", "broken"))
    entry = Overridden(
        gate=REPORT.gate, criterion="excepted", candidate="flow", comparison="<=", threshold=1.0,
        limit=2.0, by="rita", reason="r", expires="2026-12-24", verdict="FAIL", instead="PASS",
        without="FAIL",
    )  # fmt: skip
    report = REPORT.model_copy(
        update={
            "verdict": "PASS",
            "criteria": rows,
            "candidates": {"flow": "FAIL"},
            "overrides": (entry,),
        }
    )
    (fell,) = [doubt for doubt in doubts_of(report) if doubt.kind == "stopped here"]
    assert fell.text == "flow: broken"
