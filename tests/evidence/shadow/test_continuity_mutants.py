"""What continuity asks, each left out alone: noticed, also where the code itself has lost it."""

import pytest

from genpolicy.evidence.shadow import mutants
from genpolicy.evidence.shadow.continuity_mutants import (
    CLAUSES,
    ROW,
    continuity_mutant,
    continuity_mutants,
)
from genpolicy.evidence.shadow.place_mutants import UNTOLD
from genpolicy.execution import chunk_queue, stub
from genpolicy.execution.checks import CHECKS
from genpolicy.verification.report import CheckReport

UNTOLD_ALONE = {"commands_before", "person", "reset", "stop"}
"""A rig has no robot, and what is forgotten lets through what is refused otherwise."""


def test_every_clause_is_detected_by_the_rule_of_continuity_or_by_what_is_untold():
    rows = continuity_mutants()
    assert [row.check for row in rows] == [f"{ROW}:{name}" for name in CLAUSES]
    assert all(row.detected and row.slipped == row.violations_unchanged == 0 for row in rows)
    for row, name in zip(rows, CLAUSES, strict=True):
        rule = "P5.here" if name in ("here", "unseen", "motion") else "P5.continuity"
        assert row.rules == [UNTOLD if name in UNTOLD_ALONE else rule]


@pytest.mark.parametrize("name", CLAUSES)
def test_code_that_has_lost_a_clause_is_noticed_by_its_mutant(name, monkeypatch):
    for where in (chunk_queue, stub):
        monkeypatch.setattr(where, "Continuity", CLAUSES[name].lacks)
    row = continuity_mutant(CHECKS, name)
    assert not row.detected and row.violations_unchanged


@pytest.mark.parametrize("where", [chunk_queue, stub])
@pytest.mark.parametrize("name", [name for name in CLAUSES if name not in UNTOLD_ALONE])
def test_executor_and_stub_must_each_know_it(name, where, monkeypatch):
    """One that knows is enough to keep it out, so that the other could forget it unseen."""
    monkeypatch.setattr(where, "Continuity", CLAUSES[name].lacks)
    row = continuity_mutant(CHECKS, name)
    assert not row.detected and row.violations_unchanged and row.slipped


def test_a_blind_checker_is_found_by_every_clause_that_lets_something_through(monkeypatch):
    monkeypatch.setattr(mutants, "check_journal", lambda path: CheckReport())
    found = {row.check.partition(":")[2]: row.detected for row in continuity_mutants()}
    assert found == {name: name in UNTOLD_ALONE for name in CLAUSES}
