"""Answers that never came: counted by kind on Gate D's page, and beside the misses."""

import evidence
from asked import asked

from gates.evidence import Evidence
from gates.pages.figures import draw_all
from gates.pages.page import gate_page
from gates.pages.tables_faults import FAILED, FAULTS
from gates.proof import judge
from gates.stress import cost
from genpolicy.evidence.rows.stress import FaultRow

TABLE = FAULTS.removeprefix("artifacts/")


def failed(root, *rows):
    """Let `flow` be one whose process failed so often; in the conditions in their order."""
    table = [
        {"method": "flow", "perturbation": condition, "fault": fault, "count": count}
        for condition, fault, count in rows
    ]
    evidence.table(root, TABLE, FaultRow, table)
    evidence.record(root)


def test_the_page_counts_them_by_kind_and_by_condition(ladder):
    first, second, *_ = evidence.CONDITIONS
    failed(ladder, (first, "late", 3), (first, "shape", 1), (second, "late", 2))
    report = judge(ladder, "D")
    assert FAULTS in report.materials
    (found,) = draw_all((FAILED,), Evidence(ladder), report)
    assert found.listed == (
        ("method", "fault", "times"), ("flow", "late", "5"), ("flow", "shape", "1"),
    )  # fmt: skip
    ((_, lines),) = found.folded
    assert ("flow", first, "late", "3") in lines and len(lines) == 4
    assert FAILED.title in gate_page(ladder, report)


def test_the_criterion_says_how_many_of_the_misses_they_are(ladder):
    first, second, *_ = evidence.CONDITIONS
    before = asked(ladder, cost.deadline_miss_upper, "flow", gate="D")
    failed(ladder, (first, "late", 3), (second, "late", 2))
    found = asked(ladder, cost.deadline_miss_upper, "flow", gate="D")
    assert found.value == before.value
    assert found.caveat == f"{before.caveat}; of them because its process failed: late 5"
    other = asked(ladder, cost.deadline_miss_upper, "diffusion", gate="D")
    assert "process" not in other.caveat


def test_where_none_failed_it_says_so_and_of_a_ladder_of_ours_nothing(ladder, judged):
    report = judged("D")
    assert draw_all((FAILED,), Evidence(ladder), report) == []
    assert FAILED.title not in gate_page(ladder, report)
    failed(ladder, *((condition, "", 0) for condition in evidence.CONDITIONS))
    report = judge(ladder, "D")
    (found,) = draw_all((FAILED,), Evidence(ladder), report)
    assert found.listed[1:] == (("flow", "none", "0"),)
    found = asked(ladder, cost.deadline_miss_upper, "flow", gate="D")
    assert found.caveat.endswith("because its process failed: none")


def test_a_table_that_is_not_the_report_s_is_not_shown(ladder):
    failed(ladder, (evidence.CONDITIONS[0], "late", 3))
    report = judge(ladder, "D")
    failed(ladder, (evidence.CONDITIONS[0], "late", 2))
    (found,) = draw_all((FAILED,), Evidence(ladder), report)
    assert "is not the file that the report names" in found.skipped
