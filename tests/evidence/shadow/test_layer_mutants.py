"""Every row of the table of checks, taken away or made blind, is noticed by its fixture."""

from dataclasses import replace

import numpy as np
import pytest

from gates.asked_for import CHECKS_ASKED_FOR, NOT_ASKED_OF_EVERY_TASK
from genpolicy.candidates.votes import VOTE_CHECKS
from genpolicy.evidence.shadow import layer_mutants
from genpolicy.evidence.shadow.clauses import CLAUSES
from genpolicy.evidence.shadow.continuity_mutants import CLAUSES as OF_CONTINUITY
from genpolicy.evidence.shadow.continuity_mutants import ROW
from genpolicy.evidence.shadow.corruption import CORRUPTIONS, always
from genpolicy.evidence.shadow.layer_mutants import RULES, missing_checks_evidence
from genpolicy.evidence.shadow.observations import spread
from genpolicy.evidence.shadow.place_mutants import pairs
from genpolicy.evidence.shadow.stop_mutants import DEAF, PREFIX
from genpolicy.execution.checks import CHECKS as EXECUTION_CHECKS
from genpolicy.execution.checks import without
from genpolicy.feasibility.batch import Margins
from genpolicy.feasibility.checks import CHECKS
from genpolicy.verification.motion import MotionProof
from genpolicy.verification.report import CheckReport


@pytest.fixture(scope="module")
def few(observations):
    return spread(observations, 6)


@pytest.fixture(scope="module")
def rows(shadow, few):
    return missing_checks_evidence(shadow, few)


def blinded(name):
    """The table with one row that finds nothing wrong with anything."""

    def nothing(batch, cell):
        return Margins({name: np.full(len(batch), np.inf)})

    return tuple(replace(c, measure=nothing) if c.name == name else c for c in CHECKS)


def test_every_row_of_the_table_has_a_row_and_is_noticed(rows):
    assert [(row.layer, row.check) for row in rows] == [(c.layer, c.name) for c in CHECKS]
    assert [row.check for row in rows if not row.detected] == []
    assert all(0 < row.violations == row.tried for row in rows)
    assert not any(row.not_applicable for row in rows)


def test_the_gate_asks_for_every_row_of_both_tables():
    expected = [f"{check.layer}.{check.name}" for check in CHECKS]
    expected += [f"execution.{check.name}" for check in EXECUTION_CHECKS]
    expected += [f"execution.vote_{check.name}" for check in VOTE_CHECKS]
    expected += [f"execution.{PREFIX}{name}" for name in DEAF]
    expected += [f"execution.{name}@{place}" for name, place in pairs()]
    expected += [f"execution.{name}" for name in (*CLAUSES, *(f"{ROW}:{n}" for n in OF_CONTINUITY))]
    assert list(CHECKS_ASKED_FOR) == expected
    some = [c for c in CORRUPTIONS if c.check and c.applicable is not always]
    assert {f"{c.layer}.{c.check}" for c in some} == set(NOT_ASKED_OF_EVERY_TASK)


@pytest.mark.parametrize("name", [check.name for check in CHECKS])
def test_a_row_that_is_gone_or_blind_is_not_claimed_to_be_noticed(name, shadow, few, monkeypatch):
    own = tuple(item for item in CORRUPTIONS if item.check == name)
    monkeypatch.setattr(layer_mutants, "CORRUPTIONS", own)
    for table in (without(CHECKS, name), blinded(name)):
        (row,) = missing_checks_evidence(shadow, few[-2:], checks=table)
        assert row.check == name and not row.detected


def test_what_is_not_asked_of_a_task_is_declared_and_not_tried(shadow, few, monkeypatch):
    class Bare:
        obstacles = ()

        def __getattr__(self, name):
            return getattr(shadow.task, name)

    own = tuple(item for item in CORRUPTIONS if item.layer == "geometric")
    monkeypatch.setattr(layer_mutants, "CORRUPTIONS", own)
    rows = missing_checks_evidence(replace(shadow, task=Bare()), few[:1])
    excused = {row.check: row for row in rows if row.not_applicable}
    assert set(excused) == {"scene_collision", "swept_collision"}
    assert not any(row.detected or row.tried for row in excused.values())


def test_a_proof_that_proves_nothing_is_seen(shadow, few, monkeypatch):
    """Without the collisions of the independent proof every gate passed."""
    monkeypatch.setattr(layer_mutants, "check_messages", lambda *_: CheckReport())
    rows = missing_checks_evidence(shadow, few[-2:])
    assert {row.check for row in rows if not row.detected} == set(RULES)


@pytest.mark.parametrize(
    ("part", "checks"),
    [("_touching", {"contact_force", "contact_surface", "scene_collision", "self_collision"}),
     ("_swept", {"swept_collision", "measured_collision"}), ("_turning_freely", {"singular"}),
     ("_reached", {"unreachable"})],
)  # fmt: skip
def test_a_part_of_the_proof_that_is_left_out_is_seen(part, checks, shadow, few, monkeypatch):
    own = tuple(item for item in CORRUPTIONS if item.check in checks)
    monkeypatch.setattr(layer_mutants, "CORRUPTIONS", own)
    monkeypatch.setattr(MotionProof, part, lambda self, *_: iter(()))
    assert not any(row.detected for row in missing_checks_evidence(shadow, few[-2:]))
