"""The trial: fewer starts than planned give no verdict, no gain returns to the baseline."""

import evidence
from editing import cells

from gates.proof import judge


def _of(method):
    return lambda frame: frame["method"] == method


def test_no_gain_returns_to_the_best_baseline(ladder):
    evidence.edit_table(
        ladder, "stress/rollouts.parquet", cells("success", True, where=_of("chunked_bc"))
    )
    report = judge(ladder, "D")
    assert (report.verdict, report.decision) == ("FAIL", "return to chunked_bc")
    assert report.promoted is None
    assert "promotion_e_value" in report.diagnosis


def test_fewer_starts_than_planned_gives_no_verdict(ladder):
    evidence.edit_table(ladder, "stress/rollouts.parquet", lambda f: f[f["start"] < 30])
    report = judge(ladder, "D")
    assert report.verdict == "INCONCLUSIVE"
    assert report.decision.startswith("No decision")
