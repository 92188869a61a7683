"""What moved between two runs: verdicts, limits by direction, numbers, and what may be why."""

import pytest
from test_differences import REPORT
from test_verdicts import criterion

from gates.moved import moved, moved_text
from gates.report import Answer

ONE = criterion("PASS").model_copy(
    update={"id": "gap", "measured": 0.2, "threshold": 0.3, "comparison": "<=", "interval": None}
)


def between(old, new, **changes):
    """What moved from a report with one criterion to one with another."""
    before = REPORT.model_copy(update={"criteria": tuple(old)})
    after = REPORT.model_copy(update={"criteria": tuple(new), **changes})
    (gate,) = moved({"A": before}, {"A": after})
    return gate


def changed(answer: Answer, **changes) -> Answer:
    return answer.model_copy(update=changes)


def kinds(gate):
    return [(one.kind, one.criterion) for one in gate.criteria]


def test_the_same_reports_have_not_moved():
    gate = between([ONE], [ONE])
    assert gate.same and moved_text([gate]) == "A  need: PASS, the same"


def test_a_verdict_that_turned_comes_first_with_both_numbers():
    red = changed(ONE, measured=0.4, verdict="FAIL")
    other = changed(ONE, id="share", measured=0.9)
    gate = between([other, ONE], [changed(other, measured=0.8), red], verdict="FAIL")
    assert kinds(gate) == [("turned", "gap"), ("number", "share")]
    assert gate.criteria[0].before == "PASS (0.2, required <= 0.3)"
    assert gate.criteria[0].after == "FAIL (0.4, required <= 0.3)"
    assert moved_text([gate]).splitlines()[0] == "A  need: PASS -> FAIL"


@pytest.mark.parametrize(
    ("comparison", "limit", "kind"),
    [
        ("<=", 0.4, "loosened"), ("<=", 0.2, "tightened"),
        (">=", 0.4, "tightened"), (">=", 0.2, "loosened"), ("<=", None, "loosened"),
    ],
)  # fmt: skip
def test_a_limit_that_moved_says_to_which_side(comparison, limit, kind):
    """A gate that passes because its limit moved is the wrong that this is for."""
    old = changed(ONE, comparison=comparison)
    gate = between([old], [changed(old, threshold=limit)])
    assert kinds(gate) == [(kind, "gap")]


def test_another_comparison_is_neither_looser_nor_tighter():
    gate = between([ONE], [changed(ONE, comparison=">=")])
    assert kinds(gate) == [("changed", "gap")]
    gate = between([changed(ONE, threshold=None)], [ONE])
    assert kinds(gate) == [("changed", "gap")]


def test_an_interval_counts_as_a_number_also_of_what_has_none():
    old = changed(ONE, measured=None, interval=(0.1, 0.5), verdict="INCONCLUSIVE")
    (one,) = between([old], [changed(old, interval=(0.2, 0.5))]).criteria
    assert (one.kind, one.before, one.after) == ("number", "0.1 to 0.5", "0.2 to 0.5")


def test_criteria_that_came_or_went_are_said_by_candidate():
    flow = changed(ONE, candidate="flow")
    gate = between([ONE], [flow])
    assert sorted(kinds(gate)) == [("added", "gap (flow)"), ("gone", "gap")]
    assert "   added      gap (flow): PASS (0.2, required <= 0.3)" in moved_text([gate])


def test_what_may_be_why_is_named_by_key():
    names = {f"file_{n}": "0" for n in range(8)}
    gate = between([ONE], [ONE], code={"gates": "1"}, materials={"a": "1", "b": "3", **names})
    assert gate.sources == {"code": ("gates",), "materials": ("b", *sorted(names))}
    text = moved_text([gate])
    assert "because?   code: gates" in text and ", file_4 and 3 more" in text
    assert not gate.same


@pytest.mark.parametrize(("count", "more"), [(1, ""), (6, ""), (7, " and 1 more"),
                                             (9, " and 3 more")])  # fmt: skip
def test_six_keys_are_named_and_the_others_counted(count, more):
    keys = [f"k{n}" for n in range(count)]
    gate = between([ONE], [ONE], code=dict.fromkeys(keys, "1"))
    line = f"   because?   code: {', '.join(keys[:6])}{more}"
    assert moved_text([gate]).splitlines() == ["A  need: PASS", line]


def test_caveats_that_came_and_went():
    gate = between([ONE], [ONE], caveats=("two", "three"))
    assert gate.caveats == ("- one", "+ three")
    assert "   caveat     - one" in moved_text([gate])


def test_a_gate_that_only_one_run_judged():
    report = REPORT.model_copy(update={"gate": "B", "verdict": "FAIL"})
    came, went = moved({"A": REPORT}, {"B": report})
    assert (came.gate, came.before, came.after) == ("A", "PASS", "NOT JUDGED")
    assert (went.gate, went.before, went.after) == ("B", "NOT JUDGED", "FAIL")
