"""Gate A as a whole: its two routes."""

import evidence
from editing import cells

from gates.proof import judge


def _set(key, value):
    return lambda document: document.__setitem__(key, value)


def test_recovery_benefit_is_a_second_route_but_waives_no_data_check(repo):
    evidence.edit_document(repo, "audit/persistence.json", _set("observed", 0.55))
    assert judge(repo, "A").verdict == "PASS"
    evidence.edit_table(repo, "audit/clocks.parquet", cells("offset_after_s", 0.5))
    report = judge(repo, "A")
    assert report.verdict == "FAIL"
    assert "clock_residual_s" in report.diagnosis
