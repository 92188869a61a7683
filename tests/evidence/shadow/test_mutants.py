"""Each check, switched off, must turn the independent checker red; switched on, it stays silent."""

import pytest

from genpolicy.errors import ConfigError
from genpolicy.evidence.shadow.mutants import SCENARIOS, play, run_mutants
from genpolicy.execution.settings import CHECKS, known_checks


def test_every_check_has_a_scenario_and_every_mutant_is_detected():
    results = run_mutants()
    assert [result["check"] for result in results] == list(CHECKS) and set(SCENARIOS) == set(CHECKS)
    assert [result["check"] for result in results if not result["detected"]] == []
    assert all(result["violations_unchanged"] == 0 for result in results)


def test_the_rule_that_breaks_is_the_one_that_the_check_guards():
    rules = {result["check"]: set(result["rules"]) for result in run_mutants()}
    assert "P1.age" in rules["stale_observation"]
    assert "P1.valid_until" in rules["expired"]
    assert "P1.window" in rules["window"]
    assert "P1.horizon" in rules["execution_horizon"]
    assert "P2.watchdog" in rules["watchdog"]
    assert "P3.duplicate" in rules["duplicate"]
    assert "P4.chain" in rules["predecessor"]
    assert "P5.newest" in rules["superseded"]
    assert "P7.stop" in rules["stopped"]


def test_a_run_without_checks_is_declared():
    violations = play("stale_observation", disabled=frozenset({"duplicate"}))
    assert violations == []
    with pytest.raises(ConfigError, match="name in CHECKS"):
        known_checks(frozenset({"no such check"}))
