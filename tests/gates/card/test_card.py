"""The card: limits checked on every side."""

import evidence
from team import FILLED

from gates.card.card import Envelope, TrialCard, envelope_violations
from gates.card.signing import read_draft


def test_limits_are_checked_on_every_side(team):
    draft = read_draft(team.root)
    section = evidence.PARAMS["gate_e"]
    envelope = Envelope(
        workspace_lower_m=tuple(section["workspace_lower_m"]),
        workspace_upper_m=tuple(section["workspace_upper_m"]),
        speed_limit_m_s=section["speed_limit_m_s"],
        maximum_days=30,
    )
    good = TrialCard.model_validate(
        {**draft.model_dump(), **{k: v for k, v in FILLED.items() if k != "reviewer"}}
    )
    assert envelope_violations(good, draft, envelope) == []
    for change in (
        {"workspace_lower_m": (0.2, -0.2, 0.03)},
        {"workspace_lower_m": (0.71, -0.2, 0.03)},
        {"workspace_lower_m": None},
        {"speed_limit_m_s": None},
        {"speed_limit_m_s": 0.0},
        {"abort_thresholds": {}},
        {"abort_thresholds": {**draft.abort_thresholds, "latency_s": -1.0}},
    ):
        assert envelope_violations(good.model_copy(update=change), draft, envelope), change
