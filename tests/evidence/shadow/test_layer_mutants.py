"""A check left out is noticed by exactly its corruption."""

from dataclasses import replace

from genpolicy.evidence.admission_context import make_checker
from genpolicy.evidence.shadow.corruption import CORRUPTIONS
from genpolicy.evidence.shadow.layer_mutants import missing_checks_evidence
from genpolicy.feasibility.checks import without


def test_a_missing_check_is_noticed_by_exactly_its_fixture(shadow, observations, task, kit):
    blind = {
        item.checks: make_checker(
            task,
            kit.FEASIBILITY,
            action_period_s=kit.HORIZONS.action_period_s,
            checks=without(*item.checks),
        )
        for item in CORRUPTIONS
        if item.checks
    }
    rows = missing_checks_evidence(shadow, observations, without=blind)
    assert {row["check"] for row in rows} == {"+".join(checks) for checks in blind}
    assert all(row["detected"] and 0 < row["violations"] <= row["tried"] for row in rows)
    # Where the check is not really off, the table must not claim that its absence shows.
    seeing = dict.fromkeys(blind, shadow.checker)
    rows = missing_checks_evidence(shadow, observations[:5], without=seeing)
    assert not any(row["detected"] for row in rows)
    # And where everything is admitted anyway, nothing was refused that could be noticed.
    late = replace(shadow, checker=blind["expired",])
    (row,) = (
        row
        for row in missing_checks_evidence(late, observations[:5], without=blind)
        if row["fixture"] == "expired"
    )
    assert row["tried"] > 0 and not row["detected"]
