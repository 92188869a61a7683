"""A supervisor that is deaf to what stops: the arm goes on, and that is counted."""

import pytest

from gates.asked_for import CHECKS_ASKED_FOR
from genpolicy.evidence.shadow import stop_mutants as module
from genpolicy.evidence.shadow.stop_mutants import (
    COUNTED,
    DEAF,
    PREFIX,
    TICKS,
    Deaf,
    stop_mutants,
    told,
)
from genpolicy.execution.supervisor import Supervisor
from genpolicy.verification.report import CheckReport


def test_each_is_asked_for_and_detected():
    found = stop_mutants()
    assert [row.check for row in found] == [f"{PREFIX}{name}" for name in DEAF]
    assert {f"execution.{row.check}" for row in found} <= set(CHECKS_ASKED_FOR)
    assert all(row.detected and row.violations == TICKS for row in found)
    assert all(row.violations_unchanged == row.slipped == 0 for row in found)
    rules = {row.check.removeprefix(PREFIX): row.rules for row in found}
    assert rules == {
        "force": [COUNTED], "collision": [COUNTED], "emergency_stop": [COUNTED], "phase": [COUNTED],
        "silence": ["P7.silence", COUNTED], "restart": ["P7.stop", COUNTED],
        "nan_force": [COUNTED], "negative_force": [COUNTED], "unknown_force": [COUNTED],
        "unknown_collision": [COUNTED],
    }  # fmt: skip


@pytest.mark.parametrize("name", DEAF)
def test_it_is_deaf_to_that_alone(name):
    """Else a mutant of one would be found by another; who hears no force hears none of them."""
    of = {
        "force": ("phase", "nan_force", "negative_force", "unknown_force"),
        "collision": ("unknown_collision",),
    }
    for other, deaf in DEAF.items():
        deaf_too = other == name or name in of.get(other, ())
        accepted, rules = told(deaf.supervisor, DEAF[name].tell)
        assert accepted == (TICKS if deaf_too else 0)
        assert rules == ([DEAF[name].rule] if deaf_too and DEAF[name].rule else [])


@pytest.mark.parametrize("name", DEAF)
def test_where_the_true_one_is_deaf_too_it_is_not_detected(name, monkeypatch):
    monkeypatch.setattr(module, "Supervisor", DEAF[name].supervisor)
    (row,) = (row for row in stop_mutants() if row.check == f"{PREFIX}{name}")
    assert row.violations_unchanged == TICKS + bool(DEAF[name].rule) and not row.detected


@pytest.mark.parametrize("name", ["silence", "restart"])
def test_where_the_checker_is_silent_it_is_not_detected(name, monkeypatch):
    """It has heard nothing, and everybody else has: that is what it is there for."""
    monkeypatch.setattr(module, "check_journal", lambda path, expected: CheckReport())
    found = {row.check.removeprefix(PREFIX): row for row in stop_mutants()}
    assert found[name].violations == TICKS and not found[name].detected
    assert found["force"].detected


def test_where_nothing_goes_on_nothing_is_detected(monkeypatch):
    monkeypatch.setitem(DEAF, "force", Deaf(Supervisor, DEAF["force"].tell))
    row = stop_mutants()[0]
    assert (row.detected, row.violations, row.rules) == (False, 0, [])
