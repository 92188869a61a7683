"""Each row of the table of votes, taken away, must turn the independent checker red."""

import pytest

from genpolicy.candidates.votes import VOTE_CHECKS
from genpolicy.evidence.shadow.vote_mutants import PREFIX, SCENARIOS, vote_mutants
from genpolicy.verification.report import CheckReport


def test_every_row_has_a_scenario_and_every_mutant_is_detected_by_the_rule_of_votes():
    results = vote_mutants()
    names = [check.name for check in VOTE_CHECKS]
    assert [result.check for result in results] == [PREFIX + name for name in names]
    assert set(SCENARIOS) == set(names)
    assert [result.check for result in results if not result.detected] == []
    assert all(result.rules == ["P6.vote"] for result in results)


def test_a_blind_checker_turns_the_evidence_red(monkeypatch):
    monkeypatch.setattr(
        "genpolicy.evidence.shadow.mutants.check_journal", lambda path: CheckReport()
    )
    assert not any(result.detected for result in vote_mutants())


@pytest.mark.parametrize("name", sorted(SCENARIOS))
def test_a_checker_that_knows_no_votes_finds_no_mutant(monkeypatch, name):
    monkeypatch.setattr("genpolicy.verification.joined._run_out", lambda *_: "")
    found = {result.check: result for result in vote_mutants()}[PREFIX + name]
    assert found.detected == (name == "chain")  # which is asked of the chain, not of the vote
