"""How `benchmarks.audit_real` judges: the right answer, the cases of both halves, the tables."""

import json
from dataclasses import replace

from benchmarks.audit_real.__main__ import measured, sampled, so_far
from benchmarks.audit_real.catalogue import (
    AS_IS,
    BASES,
    CHANGES,
    CROSSINGS,
    ORDER_AND_NAMES,
    Case,
    development,
    report,
)
from benchmarks.audit_real.runner import Result, run
from benchmarks.audit_real.stated import TRUTH, into_page, truth_tables
from benchmarks.audit_real.tables import markdown, reliability
from benchmarks.audit_real.truth import ALLOWED, RIGHT, UNDECIDED, WRONG, Facts


def test_the_right_answer_follows_the_order_of_diagnosis():
    free = Facts(modes=2, outcomes=True)
    assert free.judged("valid_modes", "", "") == RIGHT
    assert free.judged("insufficient_support", "", "neighbourhoods") == UNDECIDED
    assert free.judged("unimodal", "", "") == WRONG
    assert replace(free, outcomes=False).judged("valid_modes", "", "") == WRONG
    open_ = replace(free, outcomes=False, undecided="far apart")
    assert open_.judged("insufficient_support", "outcome", "not_recorded") == RIGHT
    assert open_.judged("insufficient_support", "", "neighbourhoods") == ALLOWED
    broken = replace(open_, defect="unit", decided_by="task", names=("task",))
    assert broken.judged("insufficient_support", "", "") == UNDECIDED
    assert broken.judged("hidden_state", "task", "") == WRONG
    assert broken.judged("data_defect", "action", "unit") == RIGHT
    assert broken.judged("data_defect", "action", "clock") == WRONG
    assert replace(free, failing=True).judged("unimodal", "mode 1", "one_valid_mode") == RIGHT
    assert Facts().judged("unimodal", "mode 1", "one_valid_mode") == WRONG


def test_a_report_is_drawn_from_its_seed_and_shares_no_data_with_development():
    first, again, other = report(10**9 + 1), report(10**9 + 1), report(10**9 + 2)
    assert first == again and first != other
    for one in first:
        alike = [case for case in first if case.seed == one.seed]
        same = all(name in ORDER_AND_NAMES for case in alike for name, _ in case.changes)
        assert len(alike) == 1 or (same and {case.base for case in alike} == {one.base})
    assert not {case.seed for case in first} & {case.seed for case in development(100)}
    for name in BASES:
        inside = [case for case in first if case.base == name]
        assert inside[0].change == AS_IS and len(inside) > 20


def test_every_change_and_every_crossing_fits_some_base():
    cases = development(100)
    used = {name for case in cases for name, _ in case.changes}
    assert used == set(CHANGES) and len(CHANGES) >= 40
    crossed = {tuple(name for name, _ in case.changes) for case in cases}
    assert set(CROSSINGS) <= crossed


def test_the_truth_on_the_page_is_the_truth_of_the_code(tmp_path):
    page = tmp_path / "page.md"
    page.write_text(f"before\n{TRUTH[0]}\nold\n{TRUTH[1]}\nafter\n")
    cases = [Case("pushing", (("lag in half", 3.0),), 5), Case("goals", ((AS_IS, 1.0),), 5)]
    into_page(page, truth_tables(cases), TRUTH)
    text = page.read_text()
    assert "| pushing/lag in half 3 | 5 | data_defect(clock/drift/lag) |" in text
    assert "| goals/as it is | 5 | hidden_state(goal) |" in text
    assert "old" not in text and text.startswith("before") and text.endswith("after\n")


def test_a_recording_is_audited_and_its_result_read_back():
    result = run(Case("blocks", (("a third in another unit", 1000.0),), 3))
    row = json.loads(json.dumps(result.as_row()))
    assert Result.from_row(row) == result
    text = markdown([result], what="a test")
    assert ("1 recordings (a test)" in text and result.case.title in text) or result.judged == RIGHT


def test_the_reliability_table_counts_by_confidence():
    def said(judged, confidence):
        return Result("pushing", ((AS_IS, 1.0),), 1, "valid_modes", "unimodal", "", "", confidence,
                      judged, 10, 1.0)  # fmt: skip

    rows = reliability([said(RIGHT, 1.0), said(WRONG, 0.995), said(RIGHT, 0.6), said(WRONG, None)])
    assert rows[2].startswith("| 0.50 to 0.70 | 1 | 1 | 1.00")
    assert rows[3].startswith("| 0.99 to 1.00 | 2 | 1 | 0.50")


def test_a_run_that_is_cut_short_has_its_figures():
    found = [
        Result("pushing", ((AS_IS, 1.0),), seed, "valid_modes", "unimodal", "", "", 0.9, judged,
               10, 1.0)
        for seed, judged in enumerate((RIGHT, WRONG, RIGHT))
    ]  # fmt: skip
    assert so_far(found, 10) == "3 of 10: 2 right, 1 wrong"


def test_a_run_goes_on_where_it_stopped_and_a_sample_begins_with_each_base_as_it_is(tmp_path):
    cases = sampled(development(100), 100, 1)
    assert {case.base for case in cases} == set(BASES) and {c.change for c in cases} == {AS_IS}
    more = sampled(development(100), 100, 3)
    assert more[: len(cases)] == cases and len(more) == 3 * len(cases)
    known = Result(
        cases[0].base, cases[0].changes, cases[0].seed, "", "unimodal", "", "", 1.0, WRONG, 1, 1.0
    )
    (tmp_path / "results.json").write_text(json.dumps([known.as_row()]))
    assert measured(cases[:1], tmp_path / "results.json", jobs=1) == [known]


def test_another_verdict_under_other_names_is_counted():
    def said(change, verdict):
        return Result("pushing", ((change, 1.0),), 1, "valid_modes", verdict, "", "", 1.0, RIGHT, 1,
                      1.0)  # fmt: skip

    text = markdown([said(AS_IS, "valid_modes"), said("names absent", "unimodal")], what="a test")
    assert "| another verdict in another order or under other names | 1 | 1 |" in text
