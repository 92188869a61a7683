"""A supervisor that is deaf to what stops: the arm goes on, and that is counted."""

import pytest

from gates.asked_for import CHECKS_ASKED_FOR
from genpolicy.evidence.shadow import stop_mutants as module
from genpolicy.evidence.shadow.stop_mutants import DEAF, PREFIX, TICKS, accepted_after, stop_mutants
from genpolicy.execution.supervisor import Supervisor


def test_each_is_asked_for_and_detected():
    found = stop_mutants()
    assert [row.check for row in found] == [f"{PREFIX}{name}" for name in DEAF]
    assert {f"execution.{row.check}" for row in found} <= set(CHECKS_ASKED_FOR)
    assert all(row.detected and row.violations == TICKS for row in found)
    assert all(row.violations_unchanged == row.slipped == 0 for row in found)


@pytest.mark.parametrize("name", DEAF)
def test_it_is_deaf_to_that_alone(name):
    """Else a mutant of one would be found by another; who hears no force hears none of them."""
    for other, (deaf, _) in DEAF.items():
        deaf_too = other == name or (other, name) == ("force", "phase")
        assert accepted_after(deaf, DEAF[name][1]) == (TICKS if deaf_too else 0)


@pytest.mark.parametrize("name", DEAF)
def test_where_the_true_one_is_deaf_too_it_is_not_detected(name, monkeypatch):
    deaf, _ = DEAF[name]
    monkeypatch.setattr(module, "Supervisor", deaf)
    (row,) = (row for row in stop_mutants() if row.check == f"{PREFIX}{name}")
    assert row.violations_unchanged == TICKS and not row.detected


def test_where_nothing_goes_on_nothing_is_detected(monkeypatch):
    monkeypatch.setitem(DEAF, "force", (Supervisor, DEAF["force"][1]))
    row = stop_mutants()[0]
    assert (row.detected, row.violations, row.rules) == (False, 0, [])
