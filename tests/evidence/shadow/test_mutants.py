"""Each row of the table, taken away, must turn the independent checker red; else it is silent."""

from dataclasses import replace

import pytest

from genpolicy.evidence.shadow.mutants import (
    SCENARIOS,
    play,
    run_mutants,
    slipped_by,
)
from genpolicy.evidence.shadow.places import both_ask
from genpolicy.evidence.shadow.rig import IMITATED, Rig
from genpolicy.execution.checks import CHECKS, missing, without
from genpolicy.execution.executor import Executor
from genpolicy.execution.stub import ControllerStub
from genpolicy.verification.checker import check_messages
from genpolicy.verification.report import CheckReport


def test_every_check_has_a_scenario_and_every_mutant_is_detected():
    results = run_mutants()
    names = [check.name for check in CHECKS]
    assert [result.check for result in results] == names and set(SCENARIOS) == set(names)
    assert len(set(names)) == len(names)
    assert [result.check for result in results if not result.detected] == []
    assert all(result.violations_unchanged == 0 for result in results)
    assert all(result.slipped == 0 for result in results)


def test_executor_and_stub_each_keep_out_alone_what_both_ask():
    """What one of the two does not see, the other alone must refuse, exactly once."""
    twice = [check for check in CHECKS if both_ask(check.name)]
    assert len(twice) > 20
    assert [check.name for check in twice if slipped_by(check, _table(check))] == []


@pytest.mark.parametrize("blind", ["checks", "stub_checks"])
def test_a_late_chunk_is_refused_by_the_executor_and_by_the_stub(blind):
    rig = Rig(**({"stub_checks": IMITATED} | {blind: without(IMITATED, "late_chunk")}))
    SCENARIOS["late_chunk"](rig)
    assert rig.stub.accepted == 0 and rig.stub.stale == (blind == "checks")
    assert rig.executor.conservation().chunks.discarded == {"expired": 1}


def _table(check):
    return IMITATED if check in IMITATED else CHECKS


@pytest.mark.parametrize("blind", [ControllerStub, Executor])
@pytest.mark.parametrize(("fact", "check"), [("stopped", "stopped"), ("phase", "phase_transition")])
def test_a_look_that_is_none_is_found(monkeypatch, blind, fact, check):
    """With the stop taken from the stub's view, the executor still holds, and nothing else saw it:
    all gates passed."""
    honest, seen = blind._present, {"stopped": False, "phase": "insert"}
    monkeypatch.setattr(blind, "_present", lambda self: replace(honest(self), **{fact: seen[fact]}))
    (row,) = (check_ for check_ in CHECKS if check_.name == check)
    table = IMITATED
    assert slipped_by(row, table) > 0
    found = {result.check: result for result in run_mutants()}[check]
    assert found.slipped > 0 and not found.detected


def test_the_rule_that_breaks_is_the_one_that_the_check_guards():
    rules = {result.check: set(result.rules) for result in run_mutants()}
    assert "P1.age" in rules["stale_observation"]
    assert "P1.valid_until" in rules["expired"]
    assert "P1.window" in rules["window"]
    assert "P1.horizon" in rules["execution_horizon"]
    assert "P2.watchdog" in rules["watchdog"]
    assert "P3.duplicate" in rules["duplicate"]
    assert "P4.chain" in rules["predecessor"]
    assert "P5.newest" in rules["superseded"]
    assert "P5.order" in rules["behind_queued"]
    assert "P3.start" in rules["behind_accepted"]
    assert "P3.due" in rules["out_of_order"]
    assert rules["continuity"] == {"P5.continuity"} and rules["pace"] == {"P5.pace"}
    assert "P3.sequence" in rules["sequence"]
    assert "P1.bits" in rules["same_action"]
    assert "P1.state" in rules["commander"] & rules["intervention"]
    assert all("P1.void" in rules[name] for name in rules if name.startswith("after_"))
    assert "P7.stop" in rules["stopped"]
    assert rules["controller_mode"] == {"P1.controller"}
    assert rules["issued"] == {"P6.ground"}
    assert rules["divergence"] == {"P1.void"} and rules["scene"] == {"P1.scene"}


def test_a_table_without_a_row_is_declared_and_a_table_with_another_row_too():
    assert play("stale_observation", without(IMITATED, "duplicate")) == []
    assert missing(CHECKS, without(CHECKS, "duplicate"), CHECKS) == ["duplicate"]
    blind = tuple(c._replace(holds=lambda m: True) if c.name == "expired" else c for c in CHECKS)
    assert missing(blind) == ["expired"]
    assert missing(IMITATED) == ["issued"]
    for checks, names in (
        (CHECKS, []),
        (IMITATED, ["issued"]),
        (without(CHECKS, "window"), ["window"]),
    ):
        rig = Rig(checks=checks)
        assert rig.journal.events()[0].payload["checks_missing"] == names
        report = check_messages(
            (e.kind, {"session": e.session, "n": e.n, "t": e.t, **e.payload}) for e in rig.end()
        )
        assert {v.rule for v in report.violations} == ({"settings.checks"} if names else set())


def test_a_blind_checker_turns_the_evidence_red(monkeypatch):
    monkeypatch.setattr(
        "genpolicy.evidence.shadow.mutants.check_journal", lambda path: CheckReport()
    )
    assert not any(result.detected for result in run_mutants())
