"""The cost of a method: exact bounds, units of independence, and counts that cannot be."""

import evidence
import pytest
from asked import asked, settings_of
from editing import cells

from gates.evidence import MissingEvidenceError
from gates.stress import cost
from genpolicy.statistics.intervals import clopper_pearson

ROLLOUTS = "stress/rollouts.parquet"
ALL = evidence.STARTS * len(evidence.CONDITIONS)


def of(frame):
    return frame["method"] == "flow"


def test_shares_of_ticks_are_bounded_over_rollouts(ladder):
    confidence = settings_of(ladder, "D").confidence
    evidence.edit_table(ladder, ROLLOUTS, cells("fallback_ticks", 16, where=of))
    found = asked(ladder, cost.fallback_share_upper, "flow", gate="D")
    assert found.value == clopper_pearson(round(0.1 * ALL), ALL, confidence)[1]
    evidence.edit_table(ladder, ROLLOUTS, cells("deadline_misses", 20, where=of))
    assert asked(ladder, cost.deadline_miss_upper, "flow", gate="D").value == 1.0


@pytest.mark.parametrize("ticks", [161, -1])
def test_a_part_that_is_no_part_is_missing_evidence(ladder, ticks):
    evidence.edit_table(ladder, ROLLOUTS, cells("fallback_ticks", ticks, where=of, share=0.01))
    with pytest.raises(MissingEvidenceError, match="no part of ticks"):
        asked(ladder, cost.fallback_share_upper, "flow", gate="D")


def test_ages_are_those_of_rollouts_that_acted_and_never_negative(ladder):
    evidence.edit_table(ladder, ROLLOUTS, cells("action_ticks", 0, where=of, share=0.5))
    found = asked(ladder, cost.action_age_p95_s, "flow", gate="D")
    assert f"{ALL // 2} rollouts executed no action" in found.caveat
    evidence.edit_table(ladder, ROLLOUTS, cells("action_ticks", 10, where=of))
    evidence.edit_table(ladder, ROLLOUTS, cells("action_age_p95_s", -0.01, where=of, share=0.01))
    with pytest.raises(MissingEvidenceError, match="clocks are wrong"):
        asked(ladder, cost.action_age_p95_s, "flow", gate="D")


def test_a_force_is_an_order_statistic_of_what_was_measured(ladder):
    # Peaks are 5.0 + 0.1 * start in three conditions: 120 values, 95 % of them up to start 37.
    found = asked(ladder, cost.force_peak_p95_n, "flow", gate="D")
    assert found.value == pytest.approx(8.8) and "largest 8.9 N" in found.caveat


def test_every_stale_or_invalid_action_counts_and_silence_proves_nothing(ladder):
    evidence.edit_table(ladder, "stress/stub.parquet", cells("stale", 2, where=of, share=0.01))
    evidence.edit_table(ladder, "stress/stub.parquet", cells("invalid", 1, where=of, share=0.01))
    assert asked(ladder, cost.stub_violations, "flow", gate="D").value == 3.0
    assert asked(ladder, cost.stub_violations, "diffusion", gate="D").value == 0.0
    evidence.edit_table(ladder, "stress/stub.parquet", cells("arrivals", 0, where=of))
    with pytest.raises(MissingEvidenceError, match="nothing arrived"):
        asked(ladder, cost.stub_violations, "flow", gate="D")


def test_an_action_lost_and_a_reason_too_many_do_not_cancel(ladder):
    assert asked(ladder, cost.conservation_error, "flow", gate="D").value == 0.0
    table = "stress/conservation.parquet"
    evidence.edit_table(ladder, table, cells("executed", 87, where=of, share=0.01))
    assert asked(ladder, cost.conservation_error, "flow", gate="D").value == 1.0
    evidence.edit_table(ladder, "stress/counts.parquet", cells("count", 11, where=of, share=0.01))
    assert asked(ladder, cost.conservation_error, "flow", gate="D").value == 2.0
