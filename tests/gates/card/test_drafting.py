"""A draft implies nothing that people decide."""

from gates.card.card import missing_fields
from gates.card.signing import read_draft


def test_the_draft_implies_no_force_limit_and_is_pending(team):
    draft = read_draft(team.root)
    assert draft.force_limit_n is None
    assert {"force_limit_n", "spotter", "stop_path", "reviewer"} <= set(missing_fields(draft))
    report = team.judge()
    assert report.verdict == "PENDING_REVIEW"
    assert {c.verdict for c in report.criteria if c.id == "upstream_passed"} == {"PASS"}
