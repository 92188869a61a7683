"""Terms that take too long: declared at Gate B, done at Gate D; a missing action fails by name."""

import evidence
import pytest

from gates.evidence import Evidence
from gates.pages.figures import draw_all
from gates.pages.page import gate_page
from gates.pages.tables_overruns import DECLARED, DONE, FILE
from gates.proof import judge
from gates.reproducibility.timing import ACTIONS
from genpolicy.contract.latency import DeadlineAction, Term

TABLE = FILE.removeprefix("artifacts/")


def drawn(listing, root, report):
    (found,) = draw_all((listing,), Evidence(root), report)
    return found


def test_gate_b_shows_each_term_with_owner_time_and_action(whole, judged):
    found = drawn(DECLARED, whole, judged("B"))
    assert found.skipped == ""
    heads, *lines = found.listed
    assert heads[:4] == ("term", "owner", "may take, ms", "beyond it")
    assert [line[0] for line in lines] == [str(term) for term in Term]
    told = {line[0]: line[1:4] for line in lines}
    assert told["capture"] == ("model", "150", "drop_observation")  # all terms are the model's here
    assert told["project"] == ("model", "100", "reject_candidate")
    assert DECLARED.title in gate_page(whole, judged("B"))


def test_gate_b_counts_what_was_measured_beyond(ladder):
    def short(params):
        rows = params["execution"]["term_deadlines"]
        params["execution"]["term_deadlines"] = [
            [term, 1e-9 if term == "encode" else most_s, action] for term, most_s, action in rows
        ]

    evidence.write_params(ladder, short)
    heads, *lines = drawn(DECLARED, ladder, judge(ladder, "B")).listed
    told = {line[0]: line[4:] for line in lines}
    assert len(told["encode"]) == len(heads) - 4 > 0
    for cell in told["encode"]:
        count, _, of = cell.partition(" of ")
        assert count == of != "0"
    assert {cell.split()[0] for cell in told["sample"]} == {"0"}


@pytest.mark.parametrize(("change", "idle"), [
    (lambda rows: [row for row in rows if row[0] != "select"], "select"),
    (lambda rows: [[*row[:2], "shrug"] if row[0] == "queue" else row for row in rows], "queue"),
    (lambda rows: [], ", ".join(map(str, Term))),
])  # fmt: skip
def test_a_term_without_an_action_fails_gate_b_by_name(ladder, change, idle):
    def without(params):
        rows = params["execution"]["term_deadlines"]
        params["execution"]["term_deadlines"] = change(rows)

    evidence.write_params(ladder, without)
    report = judge(ladder, "B")
    (found,) = [
        item for item in report.criteria
        if item.id == "latency_terms_missing" and item.candidate == evidence.CANDIDATES[0]
    ]  # fmt: skip
    assert found.verdict == "FAIL" and found.measured == len(idle.split(", "))
    assert found.caveat.endswith(f"nothing is done where these take too long: {idle}")
    assert report.verdict == "FAIL"


def test_the_gate_knows_every_action_and_no_other():
    assert set(ACTIONS) == {str(action) for action in DeadlineAction}


def test_gate_d_counts_what_was_done_by_term_and_condition(whole, judged):
    found = drawn(DONE, whole, judged("D"))
    assert found.skipped == ""
    conditions = len(evidence.CONDITIONS)
    assert found.listed[0] == ("method", "term", "action", "times")
    assert set(found.listed[1:]) == {
        (method, term, action, f"{count * conditions}")
        for method in evidence.CANDIDATES
        for term, action, count in (("queue", "reject_stale", 3), ("select", "continue", 2))
    }
    ((title, lines),) = found.folded
    assert title == "Every condition"
    assert len(lines) == 1 + 2 * conditions * len(evidence.CANDIDATES)
    assert DONE.title in gate_page(whole, judged("D"))


def test_where_nothing_took_too_long_the_table_says_so(ladder):
    evidence.edit_table(ladder, TABLE, lambda f: f.head(1).assign(term="", action="", count=0))
    assert drawn(DONE, ladder, judge(ladder, "D")).listed[1][1:] == ("none", "none", "0")


def test_a_table_that_is_not_the_report_s_is_not_shown(ladder, judged):
    evidence.edit_table(ladder, TABLE, lambda frame: frame.head(1))
    assert "is not the file that the report names" in drawn(DONE, ladder, judged("D")).skipped
