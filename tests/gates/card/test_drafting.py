"""A draft implies nothing that people decide."""

import pytest
from evidence import edit_document

from gates.card.card import missing_fields
from gates.card.drafting import draft
from gates.card.signing import read_draft
from gates.report import GATES, read_report
from genpolicy.errors import IntegrityError


def test_the_draft_implies_no_force_limit_and_is_pending(team):
    draft = read_draft(team.root)
    assert draft.force_limit_n is None
    assert {"force_limit_n", "spotter", "stop_path", "reviewer"} <= set(missing_fields(draft))
    report = team.judge()
    assert report.verdict == "PENDING_REVIEW"
    assert {c.verdict for c in report.criteria if c.id == "upstream_passed"} == {"PASS"}


@pytest.fixture
def passed(team):
    found = {gate: read_report(team.root, gate) for gate in GATES[:4]}
    return {g: r for g, (r, _) in found.items()}, {g: digest for g, (_, digest) in found.items()}


@pytest.mark.parametrize("change", [
    lambda d: d["flow"].pop("checkpoint"), lambda d: d["flow"].update(checkpoint=""),
    lambda d: d["flow"].update(checkpoint=1), lambda d: d.pop("flow"),
])  # fmt: skip
def test_no_draft_of_a_candidate_whose_checkpoint_nobody_pinned(team, passed, change):
    assert draft(team.root, *passed) == read_draft(team.root)
    edit_document(team.root, "reload/identity.json", lambda d: change(d) and None)
    with pytest.raises(IntegrityError, match=r"flow\.checkpoint"):
        draft(team.root, *passed)


def test_no_draft_of_an_envelope_that_gate_d_did_not_judge(team, passed):
    reports, hashes = passed
    settings = {**reports["D"].settings, "perturbations": ["nominal", "camera_delay"]}
    other = {**reports, "D": reports["D"].model_copy(update={"settings": settings})}
    with pytest.raises(IntegrityError, match="without 'envelope'"):
        draft(team.root, other, hashes)
