"""Gate C in particular: checks that were never left out are undetected."""

import evidence

from gates.proof import judge


def _found(report, name):
    return [c for c in report.criteria if c.id == name]


def test_a_check_that_was_never_disabled_is_undetected(ladder):
    evidence.edit_document(ladder, "shadow/mutants.json", lambda d: d[1:])
    report = judge(ladder, "C")
    assert report.verdict == "FAIL"
    assert "representation (not tried)" in _found(report, "mutants_undetected")[0].caveat
