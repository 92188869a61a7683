"""Gate B in particular: what pins a candidate."""

import evidence

from gates.proof import judge


def _found(report, name):
    return [c for c in report.criteria if c.id == name]


def test_a_candidate_of_another_dataset_is_not_pinned(ladder):
    evidence.document(ladder, "ingest/manifest.json", {"schema_version": 2})
    report = judge(ladder, "B")
    assert report.verdict == "FAIL"
    assert "another one than the audited" in _found(report, "unpinned_items")[0].caveat
