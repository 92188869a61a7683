"""Recovery at Gate D: by phase and cause with its cost, and what is covered beyond others."""

import evidence
import pytest
from editing import cells

from gates.evidence import Evidence
from gates.pages.figures import draw_all
from gates.pages.page import gate_page
from gates.pages.tables_recovery import LISTINGS
from gates.proof import judge
from genpolicy.statistics.intervals import clopper_pearson

TABLE = "stress/recoveries.parquet"
DRILLED = [s for s in range(evidence.STARTS) if s % 3 == 0]
"""Starts whose recovery begins in `approach`."""


def drawn(root, report):
    return draw_all(LISTINGS, Evidence(root), report)


def test_each_phase_and_cause_has_a_line_with_its_interval_and_cost(whole, judged):
    by_phase, _ = drawn(whole, judged("D"))
    assert by_phase.skipped == ""
    heads, *lines = by_phase.listed
    assert len(lines) == len({*evidence.COMPARED, *evidence.CANDIDATES}) * 3
    told = {line[:3]: dict(zip(heads[3:], line[3:], strict=True)) for line in lines}
    rows = evidence.read_table(whole / "artifacts" / TABLE).to_pandas()
    own = rows[(rows["method"] == "flow") & (rows["phase"] == "approach")]
    assert list(own["start"]) == DRILLED
    line = told["flow", "approach", "drill"]
    hits, n = int(own["recovered"].sum()), len(DRILLED)
    lower, upper = clopper_pearson(hits, n, 0.95)
    assert (line["entered"], line["starts"]) == (f"{n}", f"{n}")
    assert line["recovered"] == f"{hits}, {100 * hits / n:.3g} %"
    assert line["interval"] == f"{100 * lower:.3g} to {100 * upper:.3g} %"
    times = sorted(2.0 + 0.01 * start for start in DRILLED)
    middle, high = (times[-(-p * (n - 1) // 100)] for p in (50, 95))
    assert line["time, s"] == f"{middle:.3g}, p95 {high:.3g}"
    assert line["handed back"] == f"{hits}" and line["of these by samples alone"] == "0"


def test_how_entries_ended_otherwise_is_counted(ladder):
    def ends(frame):
        own = (frame["method"] == "act") & (frame["phase"] == "insert")
        first = own & (frame["start"] == frame["start"][own].min())
        frame = frame.assign(ended=frame["ended"].mask(own, "handed_back").mask(first, "refused"))
        return frame.assign(
            resets=frame["resets"].mask(own, 0).mask(first, 2),
            resampled_only=frame["resampled_only"].mask(own, True),
        )

    insert = lambda f: (f["method"] == "act") & (f["start"] % 3 == 2)  # noqa: E731
    evidence.edit_table(ladder, "stress/rollouts.parquet", cells("recovered", False, where=insert))
    evidence.edit_table(ladder, TABLE, ends)
    by_phase, _ = drawn(ladder, judge(ladder, "D"))
    heads, *lines = by_phase.listed
    (line,) = [dict(zip(heads, line, strict=True)) for line in lines
               if line[:2] == ("act", "insert")]  # fmt: skip
    n = len([s for s in range(evidence.STARTS) if s % 3 == 2])
    assert (line["handed back"], line["of these by samples alone"]) == (f"{n - 1}", f"{n}")
    assert (line["stops to reset"], line["how else it ended"]) == ("2", "refused 1")
    assert line["a person called"] == "0"


def test_every_pair_of_candidate_and_simpler_method_stands_from_the_same_starts(whole, judged):
    _, covered = drawn(whole, judged("D"))
    heads, *lines = covered.listed
    pairs = {(c, b, "recovery_drill") for c in evidence.CANDIDATES for b in evidence.COMPARED}
    assert {line[:3] for line in lines} == pairs
    rows = evidence.read_table(whole / "artifacts/stress/rollouts.parquet").to_pandas()
    drill = rows[rows["perturbation"] == "recovery_drill"].set_index("method")["recovered"]
    for line in lines:
        told = dict(zip(heads, line, strict=True))
        own, other = (float(drill[name].mean()) for name in line[:2])
        assert (told["covered"], told["by the other"]) == (
            f"{100 * own:.3g} %", f"{100 * other:.3g} %",
        )  # fmt: skip
        gain, unit = told["difference"].split(" ")
        assert unit == "points" and float(gain) == pytest.approx(100 * (own - other), abs=0.06)
    page = gate_page(whole, judged("D"))
    assert "Recovery by phase and cause" in page and "beyond a simpler method" in page


def test_a_table_that_is_not_the_report_s_is_not_shown(ladder, judged):
    report = judged("D")
    evidence.edit_table(ladder, TABLE, lambda frame: frame.head(1))
    for found in drawn(ladder, report):
        assert "is not the file that the report names" in found.skipped


def test_one_that_did_not_run_takes_no_other_pair_away(ladder):
    """A candidate that was not admitted has no rollouts; the others are shown as ever."""
    _, before = drawn(ladder, judge(ladder, "D"))
    gone = evidence.CANDIDATES[0]
    for table in ("stress/rollouts.parquet", TABLE):
        evidence.edit_table(ladder, table, lambda frame: frame[frame["method"] != gone])
    _, after = drawn(ladder, judge(ladder, "D"))
    assert after.skipped == "" and len(after.listed) == len(before.listed)
    others = [line for line in before.listed if line[0] != gone]
    assert others and [line for line in after.listed if line[0] != gone] == others
    for line in after.listed:
        if line[0] == gone:
            assert gone in line[3] and set(line[4:]) == {""}
